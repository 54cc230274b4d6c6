"""The equations of the motions that a page plays."""

import jax

from jaxdyn.course.page.content import Page
from jaxdyn.formulations.prescribed import Prescribed
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.symbolic.equations import Equations, equations


def equations_of(page: Page) -> list[Equations]:
    """The equations of the motions that are played, in order, once for each system.

    Prescribed motions are left out, as are systems that have no formulas or whose equations would
    fill pages.
    """
    motions = [one for played in page.played for one in played.motions.values()]
    scenes = [one.scene for one in motions if isinstance(one, Trajectory)]
    moved = [scene for scene in scenes if not isinstance(scene.system, Prescribed)]
    kinds = {str(jax.tree.structure(scene.field)): scene for scene in reversed(moved)}
    found = {}
    for scene in reversed(kinds.values()):
        try:
            printed = equations(scene)
        except ValueError:
            continue
        found.setdefault(printed.text("motion"), printed)
    return list(found.values())
