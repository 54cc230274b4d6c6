"""Forces towards the origin that depend only on the distance.

A custom law is a subclass of `CentralForce` with one method: the attraction f(r) or the
energy, whose derivative it is. The other follows.
"""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn._numerics import safe_norm
from jaxdyn.scene import Effect, Points

#: Distance from the origin that no motion falls below [m], as a multiple of the square root of the
#: smallest float: its square does not underflow.
_NEAREST = 1e4
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


class CentralForce(Effect):
    """Force -f(r) e_r on each point, r being its distance from the origin.

    A subclass overrides `attraction`, or `energy`, or both. At the origin, where e_r is
    undefined, the force is 0 with the slope -f'(0), or NaN for a law that is singular there.

    Example:
      >>> import jax.numpy as jnp
      >>> class Yukawa(CentralForce):
      ...     def energy(self, r):
      ...         return -jnp.exp(-r) / r
      >>> float(Yukawa().attraction(jnp.array(1.0)))  # (1 + 1/r) e^-r / r
      0.73...
    """

    velocity_dependent: ClassVar[bool] = False
    singular: ClassVar[str] = (
        "A central force may be infinite at its centre, and has no direction there."
    )

    def attraction(self, r: Array) -> Array:
        """f(r) () [N], positive towards the origin, at the distance r () [m]."""
        if type(self).energy is CentralForce.energy:
            raise _checks.fail(
                type(self).__name__, "an `attraction` or an `energy`", "neither", "Override one."
            )
        return jax.grad(self.energy)(r)

    def energy(self, r: Array) -> Array:
        """Potential energy () [J] at the distance r () [m].

        By default it is the integral of f from 1 m to r, by a 64-point Gauss rule.

        Limits: the rule is accurate to rounding for a smooth law, and for a singular power law
          from about r = 1/50 to 50 m; override the method for a wider range.
        """
        half = 0.5 * (r - 1.0)
        return half * jnp.sum(_WEIGHTS * jax.vmap(self.attraction)(1.0 + half * (1.0 + _NODES)))

    def potential(self, t, r, m):
        del t, m
        return jnp.sum(jax.vmap(self.energy)(safe_norm(r)))

    def force(self, t, r, v, m):
        del t, v, m
        # At the origin f(r) / r is evaluated slightly beside it. A branch with its limit f'(0)
        # would put NaN into all gradients of a law that is singular there.
        distance = safe_norm(r)
        centre = distance == 0
        safe = jnp.where(centre, _NEAREST * jnp.finfo(r.dtype).tiny ** 0.5, distance)
        infinite = ~jnp.isfinite(self.attraction(jnp.zeros((), r.dtype)))
        weight = jax.vmap(self.attraction)(safe) / safe
        return -jnp.where(centre & infinite, jnp.nan, weight)[:, None] * r

    def check(self, points: Points) -> None:
        force = np.asarray(_force(self, points))
        for i in np.flatnonzero(~np.isfinite(force).all(axis=1)):
            raise _checks.fail(
                "y0",
                f"a finite {type(self).__name__} force",
                f"{force[i].tolist()} on point {i} at {np.asarray(points.r)[i].tolist()}",
                "Start away from the centre.",
            )


@eqx.filter_jit  # one program, not one for each operation
def _force(effect: CentralForce, points: Points) -> Array:
    return effect.force(jnp.zeros(()), *points)


class PowerLaw(CentralForce):
    """Attraction f(r) = k r^n towards the origin, with any real exponent n.

    The energy is k r^(n+1) / (n+1), and k log r for n = -1. The gravity of a fixed sun has n = -2,
    a spring of rest length 0 has n = 1, and for n = -1 all circular orbits have the same speed.

    Limits: the derivative of the energy with respect to n is meaningless at n = -1 itself, where
      the constant in the energy is infinite.

    Attributes:
      k: () strength of the attraction, in N/m^n.
      n: () exponent [1].
    """

    k: Array = eqx.field(converter=as_float, default=1.0)
    n: Array = eqx.field(converter=as_float, default=-2.0)

    def attraction(self, r):
        return self.k * r**self.n

    def energy(self, r):
        logarithmic = self.n == -1
        power = jnp.where(logarithmic, 1.0, self.n + 1)
        return self.k * jnp.where(logarithmic, jnp.log(r), r**power / power)
