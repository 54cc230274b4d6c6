"""How far from an orbit the linear start of a manifold may be, for a wanted error.

A start ``base + e * tangent`` misses the manifold by a term of order e^2. It shows in a map over
one period (an equilibrium has a time instead): the image of ``base + e * before`` is on the
manifold to a smaller error, and the linear prediction of it is the start itself. Their distance,
over 1 - 1/growth, is the estimate. It is measured for e, e / 4, e / 16, ..., and extrapolated
from where it falls at least as e^2: further down there is only rounding.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, ensemble
from orbits.manifolds.directions import Directions
from orbits.orbit import SearchError

_LARGEST = 0.2  # in units of the sizes of the entries, as all distances: the first e
_RUNGS = 10
_RATIO = 0.25  # of an e and the one before: halves take twice the time for the same step-off
_QUADRATIC = 9.0  # ratio of estimates at e and e / 4: 16 for an error of order e^2
_SHARE = 0.5  # of the wanted error that may be rounding


def choose(
    scene: Scene, near: Directions, signs: tuple[int, ...], error: float, rtol: float
) -> tuple[float, float]:
    """The step-off, and the estimated error of the linear starts.

    Raises:
      SearchError: the wanted error is below what rounding leaves, or none was reached.
    """
    grown = math.exp(near.rate * abs(near.span))
    es = _LARGEST * _RATIO ** np.arange(_RUNGS)
    ladder = np.concatenate([np.zeros(1), np.outer(es, signs).ravel()])
    misses = _misses(scene, near, ladder, rtol)
    rounding = misses[0] / grown
    rungs = misses[1:].reshape(_RUNGS, -1).max(axis=1) / (1 - 1 / grown)
    if not rounding <= _SHARE * error:
        raise SearchError(
            f"The orbit itself is known to {rounding:.1e} only, which the linear start cannot "
            "undercut: ask for a larger error, or find the orbit with a smaller rtol."
        )
    with np.errstate(invalid="ignore"):  # where motions end
        falls = rungs[:-1] / np.maximum(rungs[1:], np.finfo(float).tiny) >= _QUADRATIC
    for i, e in enumerate(es):
        if rungs[i] + rounding <= error:
            return float(e), float(rungs[i] + rounding)
        if i > 1 and falls[i - 2] and falls[i - 1]:
            e_wanted = float(e * math.sqrt((error - rounding) / rungs[i]))
            return e_wanted, float(error)
    raise SearchError(
        "No linear start is accurate enough: the estimated error does not fall as the square of "
        "the step-off. Ask for a larger error."
    )


def starts(scene: Scene, near: Directions, e: float, signs: tuple[int, ...]) -> np.ndarray:
    """(signs * n, k) linear starts, branch by branch, on the constraints of the scene."""
    ys = np.concatenate([near.base + sign * e * near.tangent for sign in signs])
    return np.asarray(_project(scene, jnp.asarray(np.tile(near.times, len(signs))), ys))


def _misses(scene: Scene, near: Directions, ladder: np.ndarray, rtol: float) -> np.ndarray:
    """(rungs,) the largest distance between image and prediction, infinite where a motion ends."""
    before = np.concatenate([near.base + e * near.before for e in ladder])
    after = np.concatenate([near.base + e * near.tangent for e in ladder])
    t0 = np.tile(near.times, len(ladder))
    y0s = np.asarray(_project(scene, t0, before))
    ends = ensemble.run(scene, y0s, t0 + near.span, t0=t0, rtol=rtol)
    after = _project(scene, t0, after)
    apart = np.asarray(_apart(scene, jnp.asarray(ends.y1), after)) / near.each
    apart = np.linalg.norm(apart, axis=1)
    apart = np.where(np.isfinite(apart), apart, np.inf)
    return apart.reshape(len(ladder), -1).max(axis=1)


@jax.jit
def _project(scene: Scene, ts: Array, ys: Array) -> Array:
    return jax.vmap(scene.system.project)(ts, ys)


@jax.jit
def _apart(scene: Scene, ys: Array, others: Array) -> Array:
    return jax.vmap(scene.system.difference)(ys, others)
