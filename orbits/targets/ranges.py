"""The range of a throw over all of its angles: where it is extreme, where a function is zero.

Angles are sampled as courses w = log tan(angle / 2), in which flat throws are as far apart as steep
ones; see `launch`.
"""

import numpy as np

from jaxdyn import Scene
from jaxdyn.analysis._roots import root
from jaxdyn.status import Code
from orbits.targets.launch import Landings, followed, free_sine, landings

#: Courses log tan(angle / 2) at which the range is sampled, forwards; the first is 1e-17 rad. For
#: throws that drag slows more, the first eight are stretched.
_STRETCHED = np.arange(40.0, 16.0, -3.0)
_STEEPER = np.array([16, 13.5, 11.5, 9.5, 7.5, 6, 4.8, 4, 3.3, 2.7, 2.2, 1.7, 1.3, 0.9, 0.5])
_FREE = 5.0  # courses flatter by this are free flights: their range grows with the angle
LOOK = 1e-7  # tolerance of the samples
WIDER = 1e-3  # by which a bracket found with it is widened, to remain valid with RTOL
SAME = 1e-7  # angles closer than this, at the largest range, are one


class Aim(Code):
    """Outcome of aiming."""

    FOUND = 0, "The aim was found."
    OUT_OF_REACH = 1, "No throw lands there. Throw faster, or choose a nearer target."
    NO_RANGE = (
        2,
        "No launch angle is best: throws go less far forwards the flatter they are, or do not come "
        "down. Is the wind too strong for this speed?",
    )
    LOST = (
        3,
        "Some throws could not be integrated to the ground, and one of them may be better. The "
        "drag is so strong that the fall is stiff, or the speed so high that its square exceeds "
        "all numbers: use a lower speed, a nearer target or less drag.",
    )
    NO_CONVERGENCE = (
        4,
        "The range is too rough a function of the angle to find its extremes. Is a force of the "
        "scene discontinuous?",
    )


def courses(scene: Scene, speeds: np.ndarray) -> np.ndarray:
    """(n, m) courses to sample for each speed, ascending, down to those that drag does not alter.

    With linear drag the best angle falls like log(u^2) / u in the speed u, so that no fixed set of
    courses has it. Drag has no time to act where the flight, v sin(angle) / g, is short against
    v / a with the first acceleration a: flatter courses need no samples.
    """
    flattest = _FREE - np.log(free_sine(scene, speeds))
    stretch = np.maximum(flattest, _STRETCHED[0]) - _STEEPER[0]
    part = (_STRETCHED - _STEEPER[0]) / (_STRETCHED[0] - _STEEPER[0])
    flat = _STEEPER[0] + stretch[:, None] * part
    steeper = np.broadcast_to(_STEEPER, (len(speeds), len(_STEEPER)))
    forwards = np.concatenate([flat, steeper], axis=1)
    return np.concatenate([-forwards, np.zeros((len(speeds), 1)), forwards[:, ::-1]], axis=1)


def best_courses(scene: Scene, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) course of the farthest throw for each speed, NaN if there is none, and `Aim` codes."""
    w_look = courses(scene, speeds)
    n, m = w_look.shape
    look = landings(scene, w_look, speeds[:, None], LOOK)
    x, slope = look.x.reshape(n, m), look.dx[:, 0].reshape(n, m)
    top = (slope[:, :-1] > 0) & (slope[:, 1:] <= 0)
    height = np.where(top, np.maximum(x[:, :-1], x[:, 1:]), -np.inf)
    cell = np.argmax(height, axis=1)
    found = np.isfinite(height[np.arange(n), cell])
    outcome = np.where(found, Aim.FOUND, Aim.NO_RANGE)
    w = np.full(n, np.nan)
    if found.any():
        low, high = w_look[found, cell[found]], w_look[found, cell[found] + 1]
        w[found], fine = _tops(scene, low, high, speeds[found])
        outcome[found] = np.where(fine, Aim.FOUND, Aim.NO_CONVERGENCE)
    lost = ~followed(look).reshape(n, m).all(axis=1)
    outcome = np.where(lost, Aim.LOST, outcome)
    return np.where(outcome == Aim.FOUND, w, np.nan), outcome


def turns(
    scene: Scene, w: np.ndarray, look: Landings, speed: float
) -> tuple[np.ndarray, np.ndarray]:
    """Courses of all extremes of the range between those sampled, and whether they were found."""
    rising = look.dx[:, 0] > 0
    known = np.isfinite(look.x[:-1] + look.x[1:])
    cells = np.flatnonzero((rising[:-1] != rising[1:]) & known)
    if not len(cells):
        return np.zeros(0), np.ones(0, bool)
    return _tops(scene, w[cells], w[cells + 1], np.full(len(cells), speed))


def _tops(scene: Scene, low, high, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) courses between low and high at which the range is extreme, and whether found."""

    def slope(w):
        # Its own slope would need second derivatives of the flight: three times the compile time.
        return landings(scene, w, speeds).dx[:, 0], np.full(len(w), np.nan)

    return root(slope, low - WIDER, high + WIDER)
