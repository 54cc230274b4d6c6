"""Records of the pages of the course: results, drawings, players, and the cost of digits."""

from pathlib import Path
from typing import Any

import numpy as np

from jaxdyn._text import with_null
from jaxdyn.accuracy.work_precision import work_precision
from jaxdyn.course.page import Page, Problem, displays, formulas, run
from jaxdyn.course.page.running import record
from jaxdyn.gallery.compiling import FULLY
from jaxdyn.gallery.pictures import write
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.solvers.choice import default_solver, reason

_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13)
_DIGITS = (3, 6, 9, 12)
_ROUNDS = 5


def problem_record(problem: Problem, pictures: Path) -> dict[str, Any]:
    """Run the page of a problem and write its pictures; returns its record."""
    found = run(problem.name)
    page = found.page
    return {
        **record(found),
        "problem": problem._asdict(),
        "drawings": [
            write(drawing.figure, pictures, f"{problem.name}_{i + 1}", drawing.look)
            for i, drawing in enumerate(page.drawings)
        ],
        "played": [one._asdict() for one in displays(page)],
        "equations": formulas(page),
        "digits": _digits(page),
    }


def _digits(page: Page) -> dict[str, Any] | None:
    """The cost of digits for the first motion that is played.

    None if no motion is a single solve, or if nothing is solved since the motion is prescribed.
    """
    motions = [one for played in page.played for one in played.motions.values()]
    whole = [one for one in motions if isinstance(one, Trajectory) and one.ok and one.dt is None]
    if not whole:
        return None
    scene, t1 = whole[0].scene, float(whole[0].ts[-1])
    solver = default_solver(scene)
    found = work_precision(
        scene, t1, solvers=(solver,), tolerances=_TOLERANCES, rounds=_ROUNDS, options=FULLY
    )
    rows = [(n, found.at(10.0**-n)[solver.name].median) for n in _DIGITS]
    if np.isnan([seconds for _, seconds in rows]).all():
        return None
    return {
        "solver": solver.name,
        "reason": reason(scene),
        "t1": t1,
        "rows": with_null([{"digits": n, "seconds": s} for n, s in rows]),
    }
