"""The effect of rounding on a motion, from solving it again with each step perturbed at random.

Two solutions may share the same rounding error, so that their difference hides it. Relative
perturbations in the ninth digit change the states; that change, scaled to half of the last digit,
is the effect of rounding, however it accumulates: on an orbit like the power 3/2 of the time, near
an unstable motion exponentially.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from jaxdyn.integrate.errors.estimate import gaps, scales
from jaxdyn.scene import Scene
from jaxdyn.solvers.perturbed import Noise

#: (scene, (2,) tolerance, noise of each step) -> a result whose `ys` are (s, k) states, NaN where
#: not reached.
Run = Callable[..., Any]

_PERTURBATIONS = (1e-9, 1e-13, 1e-15)  # relative to each step, to measure the effect of rounding
_MAX_LINEAR_GAP = 0.1  # part of the scale: motions farther apart do not differ linearly
_DRAWS = 2  # number of random perturbations; with one, the effects of two steps may cancel
_EPS = float(np.finfo(float).eps)


def rounding(
    run: Run, scene: Scene, ys: np.ndarray, tolerance: np.ndarray, draws: int = _DRAWS
) -> np.ndarray:
    """(s, k) the effect of rounding on the states `ys` that `run` finds at a tolerance.

    It is the root mean square of the changes of the states by random perturbations of each step,
    scaled from perturbations large enough to be measured down to half a spacing of doubles. At each
    time the largest perturbation counts with which motions stay close. Where none do, no digit is
    certain and the scale itself is returned.
    """
    scale = scales(scene, ys)
    found = np.broadcast_to(scale, ys.shape).copy()
    known = np.zeros(len(ys), bool)
    for size in _PERTURBATIONS:
        noises = [Noise(np.asarray(size), np.asarray(draw, np.uint64)) for draw in range(draws)]
        moved = [gaps(scene, np.asarray(run(scene, tolerance, noise).ys), ys) for noise in noises]
        spread = np.sqrt(np.mean(np.square(moved), axis=0))
        close = np.logical_and.accumulate((spread / scale <= _MAX_LINEAR_GAP).all(axis=1))
        new = close & ~known
        found[new] = 0.5 * _EPS / size * spread[new]
        known |= close
        if known.all():
            break
    return np.maximum(found, of_writing(ys))


def of_writing(ys: np.ndarray) -> np.ndarray:
    """(s, k) the rounding error of storing a result."""
    return 0.5 * _EPS * np.abs(ys)
