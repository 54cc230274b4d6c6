"""The closing equations of a connection, by multiple shooting with projection boundary conditions.

The unknowns are the travel time, the parameter if there is one, and the states between segments.
The chain begins at a given distance from the first rest point along its unstable eigenvector, its
links meet, and it ends at a given distance from the second, on the stable subspace there. These
linear ends are off the manifolds by terms of second order. Single shooting fails here: an error at
the passage of a rest point at a distance d grows as a power of 1/d, in the Lorenz system as
d^(-2.7).

Reference: Beyn (1990), IMA J. Numer. Anal. 10, 379; Doedel & Friedman (1989), J. Comput. Appl.
Math. 26, 155.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from orbits.manifolds.splitting import Split, split
from orbits.motion import solved

Make = Callable[[Array], Scene]
_NEWTON_STEPS, _HALVINGS = 30, 10
_GOAL = 1e-12  # largest gap, in units of the largest entry of the states or 1
_DEPENDENT = 1e-11  # smallest over largest singular value of equations that are dependent


class Chain(eqx.Module):
    """What is to be connected.

    Attributes:
      base: the scene, or any of those that `make` gives.
      make: the scene for each value of the parameter; None without one.
      near: (2, k) states near the two rest points.
      along: (k,) unstable direction at the first, with the sense of its branch.
      across: (k, c) basis of the subspace at the second that is not stable.
      cuts: (2,) real parts between the eigenvalues of these subspaces and the others.
      segments: number of links.
      rtol: tolerance of the integrations.
    """

    base: Scene
    make: Make | None = eqx.field(static=True)
    near: Array
    along: Array
    across: Array
    cuts: Array
    segments: int = eqx.field(static=True)
    rtol: float

    def scene_at(self, parameter) -> Scene:
        """The scene at a parameter, None without one."""
        return self.base if self.make is None else self.make(parameter)

    def unpack(self, x: Array) -> tuple[Array, Array | None, Array]:
        """Travel time, parameter, and the states (segments - 1, k) between links."""
        states = x[-(self.segments - 1) * self.near.shape[1] :].reshape(self.segments - 1, -1)
        return x[0], None if self.make is None else x[1], states

    def pack(self, time, parameter, states) -> np.ndarray:
        """The inverse of `unpack`."""
        extra = [] if self.make is None else [parameter]
        return np.concatenate([[time], extra, np.ravel(states)])

    def ends(self, scene: Scene) -> tuple[Split, Array, Split]:
        """The first rest point, its unit unstable direction, and the second rest point."""
        first = split(scene, self.near[0], self.cuts[0])
        v = first.projector @ self.along
        return first, v / jnp.linalg.norm(v), split(scene, self.near[1], self.cuts[1])

    def gaps(self, x: Array, steps: Array) -> Array:
        """The errors of the links, of the end across the stable subspace, and of its distance.

        `steps` (2,) are the distances of the ends from the rest points.
        """
        time, parameter, states = self.unpack(x)
        scene = self.scene_at(parameter)
        first, v, second = self.ends(scene)
        starts = jnp.concatenate([(first.rest + steps[0] * v)[None], states])
        ends = jax.vmap(
            lambda y: solved(scene.starting(y), time / self.segments, rtol=self.rtol).y1
        )(starts)
        off = scene.system.difference(ends[-1], second.rest)
        across = self.across.T @ second.projector @ off
        distance = jnp.linalg.norm(off) - steps[1]
        return jnp.concatenate([(ends[:-1] - states).ravel(), across, distance[None]])


class Solution(NamedTuple):
    """Where Newton's method ended.

    Attributes:
      x: (n,) the unknowns.
      miss: largest gap.
      converged: whether it is below the goal.
      independent: whether the equations determine all unknowns.
      doubt: (n,) change of each unknown by gaps as large as the goal.
      iterations: number of steps.
    """

    x: np.ndarray
    miss: float
    converged: bool
    independent: bool
    doubt: np.ndarray
    iterations: int


@eqx.filter_jit
def _gaps_and_slopes(chain: Chain, x, steps) -> tuple[Array, Array]:
    def doubled(x):
        gaps = chain.gaps(x, steps)
        return gaps, gaps

    slopes, gaps = jax.jacfwd(doubled, has_aux=True)(x)
    return gaps, slopes


def solve(chain: Chain, x: np.ndarray, steps: np.ndarray) -> Solution:
    """Newton's method with exact derivatives; a step that does not reduce the gaps is halved.

    With an integral of motion there are more equations than unknowns, consistent with each other:
    hence least squares.
    """
    gaps, slopes = (np.asarray(z) for z in _gaps_and_slopes(chain, x, steps))
    iterations, enough = 0, False
    while np.isfinite(gaps).all() and np.isfinite(slopes).all():
        if enough or iterations == _NEWTON_STEPS:
            break
        enough = np.abs(gaps).max() <= _goal(chain, x)  # one step more, to rounding
        change = np.linalg.lstsq(slopes, -gaps, rcond=_DEPENDENT)[0]
        for i in range(_HALVINGS):
            tried = x + 0.5**i * change
            # The slopes too, though only the gaps are compared: one program compiles, not two.
            new = tuple(np.asarray(z) for z in _gaps_and_slopes(chain, tried, steps))
            if np.linalg.norm(new[0]) < np.linalg.norm(gaps) and tried[0] > 0:
                break
        else:
            break
        x, iterations, (gaps, slopes) = tried, iterations + 1, new
    miss, goal = float(np.abs(gaps).max()), _goal(chain, x)
    if not (miss <= goal and np.isfinite(slopes).all()):
        return Solution(x, miss, False, False, np.full(len(x), np.nan), iterations)
    values = np.linalg.svd(slopes, compute_uv=False)
    doubt = goal * np.linalg.norm(np.linalg.pinv(slopes, rcond=_DEPENDENT), axis=1)
    return Solution(x, miss, True, values[-1] > _DEPENDENT * values[0], doubt, iterations)


def _goal(chain: Chain, x: np.ndarray) -> float:
    return _GOAL * max(1.0, float(np.abs(chain.unpack(x)[2]).max()))


@eqx.filter_jit
def sampled(chain: Chain, x, steps, n: int) -> tuple[Array, Array]:
    """(segments * n + 1,) times and (..., k) states, n in each link and the end."""
    time, parameter, states = chain.unpack(x)
    scene = chain.scene_at(parameter)
    first, v, _ = chain.ends(scene)
    starts = jnp.concatenate([(first.rest + steps[0] * v)[None], states])
    each = time / chain.segments
    ts = each * jnp.linspace(0.0, 1.0, n + 1)[1:]

    def link(y):
        return solved(scene.starting(y), each, ts=ts, rtol=chain.rtol).ys

    ys = jax.vmap(link)(starts)
    times = time * jnp.linspace(0.0, 1.0, chain.segments * n + 1)
    return times, jnp.concatenate([starts[:1], ys.reshape(-1, ys.shape[-1])])


@eqx.filter_jit
def state_at(chain: Chain, x, steps, t) -> tuple[Array, Array]:
    """(k,) state of the chain at a time, and the rate there."""
    time, parameter, states = chain.unpack(x)
    scene = chain.scene_at(parameter)
    first, v, _ = chain.ends(scene)
    starts = jnp.concatenate([(first.rest + steps[0] * v)[None], states])
    each = time / chain.segments
    i = jnp.clip(jnp.floor(t / each), 0, chain.segments - 1)
    y = solved(scene.starting(starts[i.astype(int)]), t - i * each, rtol=chain.rtol).y1
    return y, scene.rate(jnp.zeros(()), y)


@eqx.filter_jit
def ends(chain: Chain, x) -> tuple[Split, Array, Split]:
    """`Chain.ends` at the unknowns."""
    return chain.ends(chain.scene_at(chain.unpack(x)[1]))
