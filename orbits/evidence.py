"""Is it really an orbit? The closing error again, by another integrator and tolerance.

The finder makes its own integrator's error part of the closing condition, so its residual says
nothing about that error. Here the whole period is integrated by a method of another family at
a tighter tolerance, and then several periods in a row.
"""

import dataclasses

from jaxdyn import Status
from jaxdyn.simulate import default_solver, solve
from jaxdyn.solvers import DOPRI8, VERNER9
from orbits.problem import Orbit, gap

#: Below this, steps are lost in rounding: the tightest tolerance that still helps.
TIGHT = 1e-15


@dataclasses.dataclass(frozen=True)
class Recheck:
    """A second opinion on an orbit.

    Attributes:
      solver: name of the other method.
      tolerance: relative tolerance it ran at.
      closure: largest entry of y(T) - y(0) by that method.
    """

    solver: str
    tolerance: float
    closure: float


def closure(orbit: Orbit, *, periods: int = 1, rtol: float | None = None, solver=None) -> float:
    """Largest entry by which the state misses the start after some periods; NaN if not reached.

    A relative orbit has turned by then; its start is turned by as much.
    """
    flow = solve(
        orbit.scene,
        periods * orbit.period,
        rtol=orbit.rtol if rtol is None else rtol,
        solver=solver,
    )
    if int(flow.status) != Status.OK:
        return float("nan")
    return gap(orbit, flow.y1, periods)


def recheck(orbit: Orbit) -> Recheck:
    """The closing error of an orbit by another integrator at a tighter tolerance."""
    other = DOPRI8 if default_solver(orbit.scene) is VERNER9 else VERNER9
    return Recheck(other.name, TIGHT, closure(orbit, rtol=TIGHT, solver=other))
