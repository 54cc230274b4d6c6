"""More segments for an orbit whose residual is rounding that they may reduce."""

import numpy as np

from orbits.motion import attracts
from orbits.orbit import Orbit, Outcome
from orbits.shooting.equations import Equations
from orbits.shooting.segmentation import SEGMENTS_MOST, segments_needed, with_segments

#: Of the goal: with attracting bodies in plain time, a larger residual is rounding that more
#: segments can reduce.
_CLEAN_SHARE = 0.1
#: Largest relative difference of two spans of logarithmic time of the same motion.
_SPAN_MISMATCH = 0.01
#: Residual below which Newton's method stalls for no other reason than rounding.
_ROUNDING_STALLS = 1e-6


def finer(
    equations: Equations, cuts: Equations, guess: np.ndarray, orbit: Orbit, rtol: float
) -> Equations:
    """More segments: close encounters inside a segment amplify rounding.

    The cut is along the guess as long as the orbit is near it, else along the orbit.
    """
    left = cuts.s_period is not None and _other_motion(orbit.s_period, cuts.s_period)
    here = np.append(orbit.y0, orbit.period) if left else guess
    x = equations.spread(here[:-1], here[-1], rtol, orbit.angle)
    finer = with_segments(equations, x, rtol, segments_needed(equations, x, rtol))
    if finer.segments <= cuts.segments and not _other_motion(finer.s_period, cuts.s_period):
        finer = with_segments(equations, x, rtol, min(2 * cuts.segments, SEGMENTS_MOST))
    return finer


def gains_from_cutting(orbit: Orbit, cuts: Equations, goal: float) -> bool:
    """Whether the residual is rounding that more segments may reduce."""
    if not orbit.ok:
        return orbit.outcome == Outcome.NO_DESCENT and orbit.residual < _ROUNDING_STALLS
    if orbit.residual <= _CLEAN_SHARE * goal:
        return False
    if cuts.s_period is None:
        return attracts(orbit.scene)
    return _other_motion(orbit.s_period, cuts.s_period)


def _other_motion(a: float | None, b: float | None) -> bool:
    """Whether two spans of logarithmic time are those of different motions."""
    return a is not b if a is None or b is None else abs(a / b - 1) > _SPAN_MISMATCH
