"""The closing equations of a connection of two orbits.

The chain begins beside one orbit on its linear unstable manifold, and ends beside the other on its
linear stable one. The phases of both ends are unknown, with the time between them. If there is an
energy, the linear ends differ in it by a term of second order, and the equations depend on each
other to that order only: one more unknown, a shift of the first state along the gradient of the
energy, makes them as many as the unknowns.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.analysis.energy import energy
from orbits.manifolds.links import Links
from orbits.motion import quick_solve

_MOST_STEPS = 300  # of a link: an iterate that takes more has gone astray, into an encounter


class OrbitChain(Links):
    """Two orbits to be connected.

    The unknowns are the time, the two phases [time of the scene], the shift if there is an energy,
    and the states between links.

    Attributes:
      base: the scene.
      starts: (2, k) starts of the orbits, at phase 0.
      tangents: (2, k) tangents of length 1 there, of the unstable manifold of the first orbit and
        of the stable one of the second.
      own: (2, k) sizes of the entries along the orbits, in which distances from them are.
      each: (k,) sizes of the entries.
      conserved: whether the energy is an integral.
      segments: number of links.
      rtol: tolerance of the integrations.
    """

    base: Scene
    starts: Array
    tangents: Array
    own: Array
    each: Array
    conserved: bool = eqx.field(static=True)
    segments: int = eqx.field(static=True)
    rtol: float

    def states(self, x):
        return x[-(self.segments - 1) * self.starts.shape[1] :].reshape(self.segments - 1, -1)

    def beside(self, i: int, phase: Array, step: Array) -> tuple[Array, Array]:
        """A state (k,) of orbit i, and the one at a distance from it along the manifold."""
        known = jax.lax.stop_gradient(phase)

        def state(y):
            return quick_solve(self.base.starting(y), known, rtol=self.rtol).y1

        y, v = jax.jvp(state, (self.starts[i],), (self.tangents[i],))
        # To first order in the phase, which is all that its derivative needs.
        rate, turn = jax.jvp(lambda y: self.base.rate(jnp.zeros(()), y), (y,), (v,))
        y, v = y + rate * (phase - known), v + turn * (phase - known)
        return y, y + step * v / jnp.linalg.norm(v / self.own[i])

    def open(self, x, steps):
        y, first = self.beside(0, x[1], steps[0])
        if self.conserved:
            slope = jax.grad(lambda y: energy(self.base, 0.0, y))(jax.lax.stop_gradient(y))
            slope = slope * self.each
            first = first + x[3] * self.each * slope / jnp.linalg.norm(slope)
        return self.base, jnp.concatenate([first[None], self.states(x)]), x[0]

    def gaps(self, x, steps):
        scene, starts, time = self.open(x, steps)
        ends = self.ends(starts, time / self.segments)
        _, last = self.beside(1, x[2], steps[1])
        off = scene.system.difference(ends[-1], last)
        links = (ends[:-1] - starts[1:]) / self.each[None]
        return jnp.concatenate([links.ravel(), off / self.each])

    def ends(self, starts: Array, each: Array) -> Array:
        """(segments, k) the ends of the links.

        Each depends on its own start alone: their derivatives are computed once, not for each of
        the unknowns.
        """
        known, span = jax.lax.stop_gradient((starts, each))

        def end(y):
            run = quick_solve(self.base.starting(y), span, rtol=self.rtol, max_steps=_MOST_STEPS)
            return run.y1, run.y1

        slopes, ends = jax.vmap(jax.jacfwd(end, has_aux=True))(known)
        rates = jax.vmap(lambda y: self.base.rate(jnp.zeros(()), y))(ends)
        moved = jnp.einsum("nij,nj->ni", slopes, starts - known)
        return ends + moved + rates * (each - span)
