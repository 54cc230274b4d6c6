"""The range of a throw over all of its angles: where it is extreme, where a function is zero.

Angles are sampled as courses w = log tan(angle / 2), in which flat throws are as far apart as steep
ones; see `launch`.
"""

import numpy as np

from jaxdyn import Scene
from jaxdyn.analysis._roots import root
from jaxdyn.status import Code
from orbits.targets.launch import Landings, followed, landings

#: Courses log tan(angle / 2) at which the range is sampled, forwards; the first is 1e-17 rad.
_FLAT = np.array(
    [
        *np.arange(40.0, 16.0, -3.0),
        16.0,
        13.5,
        11.5,
        9.5,
        7.5,
        6.0,
        4.8,
        4.0,
        3.3,
        2.7,
        2.2,
        1.7,
        1.3,
        0.9,
        0.5,
    ]
)
COURSES = np.concatenate([-_FLAT, [0.0], _FLAT[::-1]])
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
        "drag is so strong that the fall is stiff: use a lower speed or less drag.",
    )
    NO_CONVERGENCE = (
        4,
        "The range is too rough a function of the angle to find its extremes. Is a force of the "
        "scene discontinuous?",
    )


def best_courses(scene: Scene, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) course of the farthest throw for each speed, NaN if there is none, and `Aim` codes."""
    n, m = len(speeds), len(COURSES)
    look = landings(scene, np.tile(COURSES, n), np.repeat(speeds, m), LOOK)
    x, slope = look.x.reshape(n, m), look.dx[:, 0].reshape(n, m)
    top = (slope[:, :-1] > 0) & (slope[:, 1:] <= 0)
    height = np.where(top, np.maximum(x[:, :-1], x[:, 1:]), -np.inf)
    cell = np.argmax(height, axis=1)
    found = np.isfinite(height[np.arange(n), cell])
    outcome = np.where(found, Aim.FOUND, Aim.NO_RANGE)
    w = np.full(n, np.nan)
    if found.any():
        low, high = COURSES[cell[found]], COURSES[cell[found] + 1]
        w[found], fine = _tops(scene, low, high, speeds[found])
        outcome[found] = np.where(fine, Aim.FOUND, Aim.NO_CONVERGENCE)
    lost = ~followed(look).reshape(n, m).all(axis=1)
    outcome = np.where(lost, Aim.LOST, outcome)
    return np.where(outcome == Aim.FOUND, w, np.nan), outcome


def turns(scene: Scene, look: Landings, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Courses of all extremes of the range between those sampled, and whether they were found."""
    rising = look.dx[:, 0] > 0
    known = np.isfinite(look.x[:-1] + look.x[1:])
    cells = np.flatnonzero((rising[:-1] != rising[1:]) & known)
    if not len(cells):
        return np.zeros(0), np.ones(0, bool)
    return _tops(scene, COURSES[cells], COURSES[cells + 1], np.full(len(cells), speed))


def _tops(scene: Scene, low, high, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) courses between low and high at which the range is extreme, and whether found."""

    def slope(w):
        # Its own slope would need second derivatives of the flight: three times the compile time.
        return landings(scene, w, speeds).dx[:, 0], np.full(len(w), np.nan)

    return root(slope, low - WIDER, high + WIDER)
