"""Two systems known for their surfaces of section: Henon-Heiles and restricted three bodies.

Both have two degrees of freedom and conserve an energy. Motions of one energy cross a plane in
points that lie on curves where they are regular, and all over an area where they are chaotic.
"""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Effect, Scene, System
from jaxdyn.scenes.ready_made import ready_made
from jaxdyn.sketch import Shape, circle
from jaxdyn.system import Points

#: Radius of attracting masses in drawings; in the equations they are points.
DRAWN = 0.02


class TriangularWell(Effect):
    """The potential (x^2 + y^2) / 2 + x^2 y - y^3 / 3 for each point of a planar system."""

    velocity_dependent: ClassVar[bool] = False
    without_units: ClassVar[bool] = True

    def potential(self, t, r, m):
        del t, m
        x, y = r[:, 0], r[:, 1]
        return jnp.sum(0.5 * (x * x + y * y) + x * x * y - y**3 / 3)

    def check(self, points):
        if points.r.shape[1] != 2:
            raise _checks.fail(
                "TriangularWell", "points of the plane", f"{points.r.shape[1]} coordinates"
            )


@ready_made()
def henon_heiles(*, x=0.0, y=0.1, vx=0.49057788, vy=0.0, t1=30.0) -> Scene:
    """The Henon-Heiles model of a star in a galaxy, chaotic from an energy of about 1/9 on.

    Motions in the triangle between the three saddles with an energy below 1/6, the height of the
    saddles, stay there. Henon and Heiles (1964), Astronomical Journal 69, 73.

    Args:
      x: initial x [1].
      y: initial y [1].
      vx: initial vx [1].
      vy: initial vy [1].
      t1: span [1].
    """
    return Scene(FreePoints([1.0]), (TriangularWell(),), y0=jnp.stack([x, y, vx, vy]), t1=t1)


class RestrictedThreeBody(System):
    """A massless body in the plane of two on circles, in the frame that rotates with them.

    The masses are 1 - mu at (-mu, 0) and mu at (1 - mu, 0); units are such that the distance of the
    two and their angular velocity are 1. The energy is -C / 2 with Jacobi's constant C (without the
    term mu (1 - mu) that some authors add).
    """

    mu: Array = eqx.field(converter=as_float, default=0.01215)
    singular: ClassVar[str] = "The attraction is infinite at the two masses."

    def labels(self):
        return ("x", "1"), ("y", "1"), ("vx", "1"), ("vy", "1")

    def points(self, t, y):
        del t  # energies are per mass
        return Points(y[None, :2], y[None, 2:], jnp.ones(1))

    def sketch(self, t, y):
        del t, y
        centres = (jnp.stack([x, 0.0 * x]) for x in (-self.mu, 1 - self.mu))
        return tuple(Shape("solid", circle(centre, DRAWN)) for centre in centres)

    def rate(self, t, y, effects):
        del t, effects
        x, y_, vx, vy = y
        mu, far = self.mu, 1 - self.mu
        one = far / ((x + mu) ** 2 + y_**2) ** 1.5
        two = mu / ((x - far) ** 2 + y_**2) ** 1.5
        ax = 2 * vy + x - one * (x + mu) - two * (x - far)
        return jnp.stack([vx, vy, ax, y_ - 2 * vx - (one + two) * y_])

    def energies(self, t, y, effects):
        del t, effects
        x, y_, vx, vy = y
        mu, far = self.mu, 1 - self.mu
        near = far / jnp.sqrt((x + mu) ** 2 + y_**2) + mu / jnp.sqrt((x - far) ** 2 + y_**2)
        return 0.5 * (vx * vx + vy * vy), -0.5 * (x * x + y_ * y_), -near

    def check(self, t, y):
        del t, y
        if not 0 < float(self.mu) < 1:
            raise _checks.fail("mu", "between 0 and 1", float(self.mu), "It is a share of mass.")


@ready_made()
def restricted_three_body(*, mu=0.01215, x=0.5, y=0.0, vx=0.0, vy=0.8, t1=20.0) -> Scene:
    """A massless body near two that circle each other, in the frame that rotates with them.

    The equilibria are the `libration_points`.

    Args:
      mu: mass of the second body as a share of the mass of both [1]; 0.01215 for the Moon.
      x: initial x [1], the masses being at -mu and 1 - mu.
      y: initial y [1].
      vx: initial vx, in the rotating frame [1].
      vy: initial vy, in the rotating frame [1].
      t1: span [1]; the two masses turn once in 2 pi.
    """
    return Scene(RestrictedThreeBody(mu), y0=jnp.stack([x, y, vx, vy]), t1=t1)


_HALVINGS = 60  # bisections of intervals shorter than 2, to the last bit
_POLISHING_STEPS = 2  # steps of Newton's method: they carry derivatives up to the third


def libration_points(mu) -> Array:
    """(5, 2) positions of the equilibria L1 to L5 of the restricted three-body problem.

    On the axis through the masses L1 is between them, L2 beyond the one at 1 - mu and L3 beyond the
    other; L4 and L5 form equilateral triangles with them, L4 with y > 0.

    Args:
      mu: mass of the second body as a share of the mass of both, between 0 and 1 [1].
    Returns:
      x and y of each [1]; the velocities there are 0. They are differentiable in mu, also under
      jit.
    Raises:
      ValueError: `mu` is not between 0 and 1.
    Reference: Szebehely (1967), Theory of Orbits, section 4.4.
    Example:
      >>> from jaxdyn import scenes
      >>> print(scenes.libration_points(0.01215)[:3, 0].round(5))
      [ 0.83692  1.15568 -1.00506]
    """
    mu = _checks.array("mu", mu, ())
    if not _checks.is_traced(mu):
        RestrictedThreeBody(mu).check(0.0, None)
    return _compiled_points(mu)


@jax.jit  # a loop outside a program captures mu, and is compiled for each value of it
def _compiled_points(mu: Array) -> Array:
    system = RestrictedThreeBody(mu)
    far, zero = 1 - mu, jnp.zeros_like(mu)

    @jax.vmap
    def pull(x):
        return system.rate(zero, jnp.stack([x, zero, zero, zero]), ())[2]

    def halved(_, bounds):
        low, high = bounds
        middle = 0.5 * (low + high)
        above = pull(middle) > 0
        return jnp.where(above, low, middle), jnp.where(above, middle, high)

    # The force along the axis increases from mass to mass, and beyond them to infinity.
    bounds = jnp.stack([-mu, far, zero - 2]), jnp.stack([far, zero + 2, -mu])
    x = jax.lax.fori_loop(0, _HALVINGS, halved, jax.lax.stop_gradient(bounds))[0]
    for _ in range(_POLISHING_STEPS):
        value, slope = jax.jvp(pull, (x,), (jnp.ones(3),))
        x = x - value / slope
    side, height = 0.5 - mu, jnp.sqrt(0.75) + zero
    return jnp.stack(
        [
            jnp.append(x, jnp.stack([side, side])),
            jnp.stack([zero, zero, zero, height, -height]),
        ],
        axis=1,
    )
