"""Newton's equations of one particle in polar coordinates: course problem 8."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn.joints import particles
from jaxdyn.scene import Points, System
from jaxdyn.system import total_force


class PolarParticle(System):
    """A particle of mass m in the plane, in polar coordinates: state r, theta, vr, omega.

    r'' = r theta'^2 + F_r / m,  theta'' = (F_theta / m - 2 r' theta') / r

    Limits: r = 0 is a singularity of the coordinates, not of the motion: a path through the
    origin itself has no omega there (NaN), one that passes near it has a short fast turn.

    Attributes:
      m: () mass [kg].
    """

    m: Array = eqx.field(converter=as_float, default=1.0)

    @property
    def accepts(self):
        return frozenset({"force"})

    def labels(self):
        return ("r", "m"), ("theta", "rad"), ("vr", "m/s"), ("omega", "rad/s")

    def points(self, t, y):
        del t
        r, theta, vr, omega = y
        e_r, e_theta = polar_basis(theta)
        position = (r * e_r)[None, :]
        return Points(position, (vr * e_r + r * omega * e_theta)[None, :], self.m[None])

    def bodies(self, t, y):
        return particles(self.points(t, y).m)

    def rate(self, t, y, effects):
        r, theta, vr, omega = y
        force = total_force(effects, t, *self.points(t, y))[0]
        e_r, e_theta = polar_basis(theta)
        a_r = jnp.sum(force * e_r) / self.m + r * omega * omega
        a_theta = (jnp.sum(force * e_theta) / self.m - 2 * vr * omega) / r
        return jnp.stack([vr, omega, a_r, a_theta])

    def check(self, t, y):
        del t
        _checks.positive("mass", self.m, "Masses are in kg.")
        if not _checks.is_traced(y) and y[0] == 0:
            raise _checks.fail(
                "y0", "r not 0", "r = 0", "There theta has no meaning; start beside the origin."
            )


@jax.jit  # one program, not one for each operation
def polar_state(position: Array, velocity: Array) -> Array:
    """(4,) the state of a `PolarParticle` at a position (2,), not the origin, and velocity (2,).

    At the origin its r is 0, which the particle refuses by name; its rates are 0 then, not NaN.
    """
    (x, y), (vx, vy) = position, velocity
    r2 = x * x + y * y
    r2 = jnp.where(r2 > 0, r2, jnp.inf)
    r = jnp.sqrt(r2)
    along, across = (x * vx + y * vy) / r, (x * vy - y * vx) / r2
    return jnp.stack([jnp.where(r < jnp.inf, r, 0.0), jnp.arctan2(y, x), along, across])


def polar_basis(theta: Array) -> tuple[Array, Array]:
    """(2,) unit vectors e_r and e_theta."""
    c, s = jnp.cos(theta), jnp.sin(theta)
    return jnp.stack([c, s]), jnp.stack([-s, c])
