"""Chains of segments of a motion whose gaps Newton's method closes.

The first of the unknowns is the time that the chain takes; the kind of chain determines the others,
and where the first and last states may lie. Gaps and distances are in the sizes of the entries; the
unit of an unknown is the change that makes gaps of about that size.
"""

import abc
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.continuation import newton
from orbits.motion import quick_solve

_NEWTON_STEPS, _HALVINGS = 30, 9
_GOAL = 1e-12  # largest gap, relative to the largest scaled entry of the states, or to 1
_DEPENDENT = 1e-11  # smallest over largest singular value below which equations are dependent


class Links(eqx.Module):
    """A chain of segments.

    Attributes:
      each: (k,) sizes of the entries of the state.
      segments: number of links.
      rtol: tolerance of the integrations.
    """

    each: eqx.AbstractVar[Array]
    segments: eqx.AbstractVar[int]
    rtol: eqx.AbstractVar[float]

    @abc.abstractmethod
    def open(self, x: Array, steps: Array) -> tuple[Scene, Array, Array]:
        """The scene, the starts (segments, k) of the links, and their total time, at unknowns x.

        `steps` (2,) are the distances of the ends of the chain from what it connects.
        """

    def states(self, x: Array) -> Array:
        """The states (segments - 1, k) between links, which are the last of the unknowns."""
        return x[-(self.segments - 1) * len(self.each) :].reshape(self.segments - 1, -1)

    @abc.abstractmethod
    def gaps(self, x: Array, steps: Array) -> Array:
        """The errors of the links and of the end, in sizes."""


class Solution(NamedTuple):
    """Where Newton's method ended.

    Attributes:
      x: (n,) the unknowns.
      residual: largest gap.
      converged: whether that gap is below the goal.
      independent: whether the equations determine all unknowns.
      uncertainty: (n,) change of each unknown by gaps as large as the goal.
      iterations: number of steps.
    """

    x: np.ndarray
    residual: float
    converged: bool
    independent: bool
    uncertainty: np.ndarray
    iterations: int


@eqx.filter_jit
def _gaps_and_slopes(chain: Links, x, steps) -> tuple[Array, Array]:
    return value_and_jacfwd(lambda x: chain.gaps(x, steps))(x)


def solve(chain: Links, x: np.ndarray, steps: np.ndarray) -> Solution:
    """The chain without gaps near unknowns x (n,), by damped steps of Newton's method.

    Steps are least-squares solutions, since with an integral of motion there are more equations
    than unknowns, which are consistent with each other.
    """
    first = tuple(np.asarray(z) for z in _gaps_and_slopes(chain, x, steps))
    units = _units(first[1])

    def equations(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        tried = x + units * z
        if not tried[0] > 0:  # a chain takes some time
            return np.full(first[0].shape, np.nan), first[1]
        # Slopes are computed even where only gaps are compared, so that one program is compiled.
        gaps, slopes = _gaps_and_slopes(chain, tried, steps) if z.any() else first
        return np.asarray(gaps), np.asarray(slopes) * units

    found = newton.solve(
        equations,
        np.zeros(len(x)),
        steps=_NEWTON_STEPS,
        rank=_DEPENDENT,
        polish=1,
        halvings=_HALVINGS,
    )
    x, residual, iterations = x + units * found.x, found.residual, found.iterations
    goal = _GOAL * max(1.0, float(np.abs(chain.states(x) / np.asarray(chain.each)).max()))
    if not (found.finite and residual <= goal):
        return Solution(x, residual, False, False, np.full(len(x), np.nan), iterations)
    slopes = found.jacobian / units
    units = _units(slopes)
    values = np.linalg.svd(slopes * units, compute_uv=False)
    inverse = np.linalg.pinv(slopes * units, rcond=_DEPENDENT)
    uncertainty = goal * units * np.linalg.norm(inverse, axis=1)
    return Solution(x, residual, True, values[-1] > _DEPENDENT * values[0], uncertainty, iterations)


def _units(slopes: np.ndarray) -> np.ndarray:
    """(n,) units of the unknowns in which derivatives with respect to them (m, n) have length 1."""
    lengths = np.linalg.norm(slopes, axis=0)
    return 1 / np.where(lengths > 0, lengths, 1.0)


@eqx.filter_jit
def sample(chain: Links, x, steps, n: int) -> tuple[Array, Array]:
    """(segments * n + 1,) times and (..., k) states: n in each link, and the end."""
    scene, starts, time = chain.open(x, steps)
    each = time / chain.segments
    ts = each * jnp.linspace(0.0, 1.0, n + 1)[1:]

    def link(y):
        return quick_solve(scene.starting(y), each, ts=ts, rtol=chain.rtol).ys

    ys = jax.vmap(link)(starts)
    times = time * jnp.linspace(0.0, 1.0, chain.segments * n + 1)
    return times, jnp.concatenate([starts[:1], ys.reshape(-1, ys.shape[-1])])
