"""The proof that a list of equilibria is complete, by ball arithmetic (`ball_arithmetic.zeros`)."""

from collections.abc import Sequence

import numpy as np

from jaxdyn._text import number_of
from jaxdyn.analysis.equilibrium_search.proof import EquilibriaProof
from jaxdyn.analysis.equilibrium_search.search import Box
from jaxdyn.ball_arithmetic.decimals import decimal
from jaxdyn.ball_arithmetic.enclosed import Enclosed
from jaxdyn.ball_arithmetic.field import ball_field, scene_formulas
from jaxdyn.ball_arithmetic.zeros import BITS, zeros
from jaxdyn.scene import Scene

_NAMED = 5  # largest number of boxes that the text lists


def prove(scene: Scene, t: float, box: Box) -> EquilibriaProof:
    """All equilibria of a scene in a box at time t.

    Raises:
      ValueError: the rate is not made of elementary functions.
    """
    field = ball_field(scene_formulas(scene)[0])
    found = zeros(field, t, np.asarray(box.low), np.asarray(box.high))
    left = tuple(tuple(decimal(x) for x in cell) for cell in found.left)
    if left:
        reason = (
            f"{number_of(len(left), 'box', 'boxes')} could not be decided, near {_places(left)}: "
            "the Jacobian is singular there, or the rate is not smooth, or the box is too large. "
            "Prove a smaller box."
        )
    else:
        reason = (
            "interval bisection in ball arithmetic: Krawczyk's test of each box that holds one, "
            "bounds that exclude 0 of each other."
        )
        if found.corners:
            corners = [[decimal(x) for x in box] for box in found.corners]
            reason += (
                f" Near {_places(corners)} a length is 0 and the rate jumps: 0 is excluded in all "
                "directions of its unit vector, and at the point itself."
            )
    return EquilibriaProof(
        proved=not left,
        reason=reason,
        points=tuple(tuple(decimal(x) for x in point) for point in found.found),
        undecided=left,
        discarded=found.discarded,
        names=tuple(name for name, _ in scene.labels()),
        bits=BITS,
    )


def _places(boxes: Sequence[Sequence[Enclosed]]) -> str:
    return "; ".join(", ".join(f"{float(x.mid):.6g}" for x in box) for box in boxes[:_NAMED])
