"""Newton-Euler equations from the kinematic map, without reactions and energies.

With r = r(t, q), J = dr/dq and c the accelerations of the points for a = 0,
d'Alembert's principle J^T (f - m (J a + c)) = 0 gives

    (J^T m J) a = J^T (f - m c) + Q.

J and c are first and second forward derivatives of the map, far cheaper than the Hessian of a
Lagrangian.
"""

import jax
import jax.numpy as jnp

from jaxdyn._numerics import solve_spd
from jaxdyn.formulations.mechanism import (
    Mechanism,
    MechanismSystem,
    mass_and_force,
    positions_and_velocities,
)


class NewtonEuler(MechanismSystem):
    """A mechanism whose coordinates are free: state [q, v]."""

    mechanism: Mechanism

    def rate(self, t, y, effects):
        q, v = jnp.split(y, 2)
        mass, force = mass_and_force(self.mechanism, jnp.asarray(t, y.dtype), q, v, effects)
        return jnp.concatenate([v, solve_spd(mass, force)])

    def canonical(self, t, y):
        q, v = jnp.split(y, 2)

        def kinetic(v):
            velocity = positions_and_velocities(self.mechanism, jnp.asarray(t, y.dtype), q, v)[1]
            return 0.5 * jnp.sum(self.mechanism.masses()[:, None] * velocity**2)

        return jnp.concatenate([q, jax.grad(kinetic)(v)])
