"""Lagrange's equations, straight from the energies by automatic differentiation.

    L = T - V,    (d2L/dv2) a = dL/dq - (d2L/dq dv) v - d2L/dt dv + Q,

where V sums the potentials of the effects that have one, and Q pulls back the forces of those
that have none. It takes second derivatives of the energies at each step: the route to compare
others with (newton_euler is faster), and the one that follows a textbook line by line.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._numerics import solve_spd
from jaxdyn.formulations.mechanism import (
    Mechanism,
    MechanismSystem,
    moved,
    on_coordinates,
    pulled_back,
)
from jaxdyn.scene import Effect
from jaxdyn.system import potential_energy


class Lagrange(MechanismSystem):
    """A mechanism whose coordinates are free: state [q, v]."""

    mechanism: Mechanism

    def lagrangian(self, t: Array, q: Array, v: Array, effects: tuple[Effect, ...]) -> Array:
        """Kinetic minus potential energy () [J]."""
        r, velocity = moved(self.mechanism, t, q, v)
        m = self.mechanism.masses()
        kinetic = 0.5 * jnp.sum(m[:, None] * velocity**2)
        return kinetic - potential_energy(effects, t, r, m)

    def rate(self, t, y, effects):
        q, v = jnp.split(y, 2)
        t = jnp.asarray(t, y.dtype)
        energetic, others = self._sorted(effects, t, y)

        def momenta(t, q, v):
            return jax.grad(self.lagrangian, argnums=2)(t, q, v, energetic)

        slope = jax.grad(self.lagrangian, argnums=1)(t, q, v, energetic)
        change = jax.jvp(lambda t, q: momenta(t, q, v), (t, q), (jnp.ones_like(t), v))[1]
        mass = jax.jacfwd(momenta, argnums=2)(t, q, v)
        force = slope - change + on_coordinates(t, q, v, effects)
        if others:
            force = force + pulled_back(self.mechanism, t, q, v, others)
        return jnp.concatenate([v, solve_spd(mass, force)])

    def canonical(self, t, y):
        q, v = jnp.split(y, 2)
        p = jax.grad(self.lagrangian, argnums=2)(jnp.asarray(t, y.dtype), q, v, ())
        return jnp.concatenate([q, p])

    def _sorted(self, effects: tuple[Effect, ...], t: Array, y: Array):
        """The effects with a potential, and those without."""
        r, _, m = self.points(t, y)
        has = [effect.potential(t, r, m) is not None for effect in effects]
        energetic = tuple(e for e, yes in zip(effects, has, strict=True) if yes)
        return energetic, tuple(e for e, yes in zip(effects, has, strict=True) if not yes)
