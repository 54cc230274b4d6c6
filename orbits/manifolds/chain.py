"""The closing equations of a connection, by multiple shooting with projection boundary conditions.

The unknowns are the travel time, the parameter if there is one, and the states between segments.
The chain begins at a given distance from the first equilibrium along its unstable eigenvector, its
links meet, and it ends at a given distance from the second, on the stable subspace there. These
linear ends are off the manifolds by terms of second order. Single shooting fails here: an error at
the passage of an equilibrium at a distance d grows as a power of 1/d, in the Lorenz system as
d^(-2.7).

Reference: Beyn (1990), IMA J. Numer. Anal. 10, 379; Doedel & Friedman (1989), J. Comput. Appl.
Math. 26, 155.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from orbits.manifolds.links import Links
from orbits.manifolds.splitting import Split, split
from orbits.motion import quick_solve

Make = Callable[[Array], Scene]


class Chain(Links):
    """What is to be connected.

    Attributes:
      base: the scene, or any of those that `make` gives.
      make: the scene for each value of the parameter; None without one.
      near: (2, k) states near the two equilibria.
      along: (k,) unstable direction at the first, with the sense of its branch.
      across: (k, c) basis of the subspace at the second that is not stable, in sizes.
      each: (k,) sizes of the entries.
      cuts: (2,) real parts between the eigenvalues of these subspaces and the others.
      segments: number of links.
      rtol: tolerance of the integrations.
    """

    base: Scene
    make: Make | None = eqx.field(static=True)
    near: Array
    along: Array
    across: Array
    each: Array
    cuts: Array
    segments: int = eqx.field(static=True)
    rtol: float

    def scene_at(self, parameter) -> Scene:
        """The scene at a parameter, None without one."""
        return self.base if self.make is None else self.make(parameter)

    def unpack(self, x: Array) -> tuple[Array, Array | None, Array]:
        """Travel time, parameter, and the states (segments - 1, k) between links."""
        return x[0], None if self.make is None else x[1], self.states(x)

    def states(self, x: Array) -> Array:
        return x[-(self.segments - 1) * self.near.shape[1] :].reshape(self.segments - 1, -1)

    def pack(self, time, parameter, states) -> np.ndarray:
        """The inverse of `unpack`."""
        extra = [] if self.make is None else [parameter]
        return np.concatenate([[time], extra, np.ravel(states)])

    def ends(self, scene: Scene) -> tuple[Split, Array, Split]:
        """The first equilibrium, its unstable direction of length 1, and the second equilibrium."""
        first = split(scene, self.near[0], self.cuts[0], self.each)
        v = first.projector @ self.along
        v = v / jnp.linalg.norm(v / self.each)
        return first, v, split(scene, self.near[1], self.cuts[1], self.each)

    def open(self, x: Array, steps: Array) -> tuple[Scene, Array, Array]:
        time, parameter, states = self.unpack(x)
        scene = self.scene_at(parameter)
        first, v, _ = self.ends(scene)
        return scene, jnp.concatenate([(first.rest + steps[0] * v)[None], states]), time

    def gaps(self, x: Array, steps: Array) -> Array:
        """The errors of the links, of the end across the stable subspace, and of its distance.

        `steps` (2,) are the distances of the ends from the equilibria.
        """
        scene, starts, time = self.open(x, steps)
        _, _, second = self.ends(scene)
        states = starts[1:]
        ends = jax.vmap(
            lambda y: quick_solve(scene.starting(y), time / self.segments, rtol=self.rtol).y1
        )(starts)
        off = scene.system.difference(ends[-1], second.rest)
        across = self.across.T @ (second.projector @ off / self.each)
        distance = jnp.linalg.norm(off / self.each) - steps[1]
        links = (ends[:-1] - states) / self.each[None]
        return jnp.concatenate([links.ravel(), across, distance[None]])


@eqx.filter_jit
def state_at(chain: Chain, x, steps, t) -> tuple[Array, Array]:
    """(k,) state of the chain at a time, and the rate there."""
    scene, starts, time = chain.open(x, steps)
    each = time / chain.segments
    i = jnp.clip(jnp.floor(t / each), 0, chain.segments - 1)
    y = quick_solve(scene.starting(starts[i.astype(int)]), t - i * each, rtol=chain.rtol).y1
    return y, scene.rate(jnp.zeros(()), y)


@eqx.filter_jit
def ends(chain: Chain, x) -> tuple[Split, Array, Split]:
    """`Chain.ends` at the unknowns."""
    return chain.ends(chain.scene_at(chain.unpack(x)[1]))
