"""The Lorenz system: course problem 3."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._checks import as_float
from jaxdyn.scene import Scene, System
from jaxdyn.scenes.ready_made import ready_made


class Lorenz(System):
    """The Lorenz equations: a system without material points; x, y, z and time are pure numbers.

    x' = sigma (y - x),  y' = x (rho - z) - y,  z' = x y - beta z
    """

    sigma: Array = eqx.field(converter=as_float, default=10.0)
    rho: Array = eqx.field(converter=as_float, default=28.0)
    beta: Array = eqx.field(converter=as_float, default=8 / 3)

    def labels(self):
        return ("x", "1"), ("y", "1"), ("z", "1")

    def rate(self, t, y, effects):
        del t, effects
        x, y, z = y
        return jnp.stack([self.sigma * (y - x), x * (self.rho - z) - y, x * y - self.beta * z])


@ready_made()
def lorenz(*, sigma=10.0, rho=28.0, beta=8 / 3, y0=(1.0, 1.0, 1.0), t1=20.0) -> Scene:
    """The Lorenz system, chaotic at its usual numbers (problem 3).

    Nearby motions part like e^(0.9 t), so a solution at tolerance 1e-13 is lost after some
    35 time units whatever the method; that is right, not an error.

    Args:
      sigma: Prandtl number [1].
      rho: Rayleigh number over its critical value [1].
      beta: shape of the convection cell [1].
      y0: (3,) start.
      t1: span.
    """
    return Scene(Lorenz(sigma, rho, beta), y0=y0, t1=t1)
