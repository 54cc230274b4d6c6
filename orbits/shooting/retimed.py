"""Guesses whose start is periodic already, so that only the period has to be found.

Newton's method finds one member of a family near the guess, and an error of the guessed period
alone makes it change the start as well. If the given start closes after a time near the guessed
period, that orbit is the one requested.
"""

import numpy as np

from orbits.shooting.units import InUnits

_STEPS_MOST = 10  # convergence is quadratic
#: Share of the residual that may remain after a step of the period alone: more means that the
#: start is not periodic.
_SHARE_LEFT_MOST = 0.7
_PERIOD_FACTOR_MOST = 2.0  # between the periods found and guessed


@np.errstate(over="ignore")  # of extreme conditions, e.g. an energy of 1e300; then x is returned
def retime(
    closed: InUnits, x: np.ndarray, *, lower: np.ndarray, upper: np.ndarray, goal: float
) -> np.ndarray:
    """x with the period after which its start closes, or x itself if none is near.

    Everything but the start may change: the period, the states between segments, the angle of a
    relative orbit. A start that is not periodic costs one integration: the linearised equations
    then have no solution in these unknowns.

    Args:
      closed: the closing equations.
      x: (n,) the guess.
      lower: (n,) lower bounds of x.
      upper: (n,) upper bounds of x.
      goal: largest entry of the residual of an orbit.
    """
    equations, units = closed.equations, closed.units.x
    free = np.arange(len(x)) >= len(equations.closing.free(len(equations.scene.y0)))
    free[-1] = not equations.driven
    new = x
    for _ in range(_STEPS_MOST if free.any() else 0):
        residual, jacobian = closed(new)
        if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
            break
        if np.abs(residual).max() <= goal:
            return new
        slopes = jacobian[:, free]
        step = np.linalg.lstsq(slopes, -residual, rcond=None)[0]
        if np.linalg.norm(residual + slopes @ step) > _SHARE_LEFT_MOST * np.linalg.norm(residual):
            break
        new = new.copy()
        new[free] += step * units[free]
        if not ((lower <= new) & (new <= upper)).all() or not _near(new[-1] / x[-1]):
            break
    return x


def _near(factor: float) -> bool:
    return 1 / _PERIOD_FACTOR_MOST < factor < _PERIOD_FACTOR_MOST
