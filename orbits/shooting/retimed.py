"""A start that is periodic as it is: only the period is wanted.

Of the many members of a family Newton's method finds one near the guess; an error of the guessed
period alone makes it move the start as well. Where the given start closes for some period near
the guess, that is the orbit that was meant.
"""

import numpy as np

from orbits.shooting.equations import Equations

_STEPS = 10  # at most; convergence is quadratic
_ALONG = 0.7  # of the residual: if the start's neighbours must make up for more, it is not periodic
_FAR = 2.0  # factor on the period from which on it is another orbit


@np.errstate(over="ignore")  # an energy of 1e300 is wanted: no step is allowed, see the bounds
def retimed(equations: Equations, x: np.ndarray, lower, upper, goal: float, rtol: float):
    """x with another period such that its start closes, or x itself if there is none near it.

    All but the start may change: with the period the states between segments and the angle of a
    relative orbit. A start that is not periodic costs one integration, in which the residual is
    seen not to lie along what may change.

    Args:
      equations: what must close, conditions included.
      x: (n,) the guess.
      lower: (n,) bounds of x.
      upper: (n,) bounds of x.
      goal: largest entry of the residual of an orbit.
      rtol: tolerance of the integrations.
    """
    free = np.arange(len(x)) >= len(equations.closing.free(len(equations.scene.y0)))
    free[-1] = not equations.driven
    new = x
    for _ in range(_STEPS if free.any() else 0):
        residual, jacobian, *_ = equations(new, rtol)
        if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
            break
        if np.abs(residual).max() <= goal:
            return new
        slopes = np.asarray(jacobian)[:, free]
        step = np.linalg.lstsq(slopes, -np.asarray(residual), rcond=None)[0]
        if np.linalg.norm(residual + slopes @ step) > _ALONG * np.linalg.norm(residual):
            break
        new = new.copy()
        new[free] += step
        if not ((lower <= new) & (new <= upper)).all() or not 1 / _FAR < new[-1] / x[-1] < _FAR:
            break
    return x
