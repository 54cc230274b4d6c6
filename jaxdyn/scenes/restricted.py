"""Bodies of no mass in axes that turn: the restricted three bodies in space, and Hill's problem.

The restricted three bodies in the plane are in `sections`.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn.scene import Scene, System
from jaxdyn.scenes.ready_made import ready_made
from jaxdyn.scenes.sections import DRAWN
from jaxdyn.sketch import Shape, circle
from jaxdyn.system import Points


class RestrictedThreeBodyInSpace(System):
    """A third body of no mass near two on circles, in axes that turn with them; z is their axis.

    Masses 1 - mu at (-mu, 0, 0) and mu at (1 - mu, 0, 0); distances and times in units in which
    theirs and their angular velocity are 1. The energy is -C / 2 with Jacobi's constant C (without
    the term mu (1 - mu) that some authors add).
    """

    mu: Array = eqx.field(converter=as_float, default=0.01215)
    singular: ClassVar[str] = "The attraction is infinite at the two masses."

    def labels(self):
        return tuple((name, "1") for name in ("x", "y", "z", "vx", "vy", "vz"))

    def points(self, t, y):
        del t  # energies are per mass
        return Points(y[None, :3], y[None, 3:], jnp.ones(1))

    def rate(self, t, y, effects):
        del t, effects
        x, y_, z, vx, vy, vz = y
        mu, far = self.mu, 1 - self.mu
        off = y_ * y_ + z * z
        one = far / ((x + mu) ** 2 + off) ** 1.5
        two = mu / ((x - far) ** 2 + off) ** 1.5
        ax = 2 * vy + x - one * (x + mu) - two * (x - far)
        return jnp.stack([vx, vy, vz, ax, y_ - 2 * vx - (one + two) * y_, -(one + two) * z])

    def energies(self, t, y, effects):
        del t, effects
        x, y_, z, vx, vy, vz = y
        mu, far = self.mu, 1 - self.mu
        off = y_ * y_ + z * z
        near = far / jnp.sqrt((x + mu) ** 2 + off) + mu / jnp.sqrt((x - far) ** 2 + off)
        return 0.5 * (vx * vx + vy * vy + vz * vz), -0.5 * (x * x + y_ * y_), -near

    def check(self, t, y):
        del t, y
        if not 0 < float(self.mu) < 1:
            raise _checks.fail("mu", "between 0 and 1", float(self.mu), "It is a share of mass.")


@ready_made()
def restricted_three_body_in_space(
    *, mu=0.01215, x=0.8234, y=0.0, z=0.0224, vx=0.0, vy=0.1343, vz=0.0, t1=2.75
) -> Scene:
    """A body of no mass near two that circle each other, in and out of their plane.

    The axes turn with the two, and z is the axis of their circles. Its equilibria are the
    `libration_points`, at z = 0; halo orbits lie about them.

    Args:
      mu: mass of the second body as a share of both [1]; 0.01215 for the Moon.
      x: at the start [1], the masses being at -mu and 1 - mu.
      y: at the start [1].
      z: at the start [1].
      vx: at the start, in the turning axes [1].
      vy: at the start, in the turning axes [1].
      vz: at the start [1].
      t1: span [1]; the two masses turn once in 2 pi.
    """
    y0 = jnp.stack([x, y, z, vx, vy, vz])
    return Scene(RestrictedThreeBodyInSpace(mu), y0=y0, t1=t1)


class Hill(System):
    """A body of no mass near a planet that circles the Sun, in axes that turn with the planet.

    Hill's limit of the restricted three bodies for a small mu, with lengths in units of mu^(1/3):
    the planet is the origin, the Sun far away on the negative x axis. The energy is -C / 2 with
    Jacobi's constant C of Hill's problem.
    """

    singular: ClassVar[str] = "The attraction is infinite at the planet."

    def labels(self):
        return tuple((name, "1") for name in ("x", "y", "vx", "vy"))

    def points(self, t, y):
        del t  # energies are per mass
        return Points(y[None, :2], y[None, 2:], jnp.ones(1))

    def sketch(self, t, y):
        del t, y
        return (Shape("solid", circle(jnp.zeros(2), DRAWN)),)

    def rate(self, t, y, effects):
        del t, effects
        x, y_, vx, vy = y
        pull = 1 / (x * x + y_ * y_) ** 1.5
        return jnp.stack([vx, vy, 2 * vy + 3 * x - pull * x, -2 * vx - pull * y_])

    def energies(self, t, y, effects):
        del t, effects
        x, y_, vx, vy = y
        return 0.5 * (vx * vx + vy * vy), -1.5 * x * x, -1 / jnp.sqrt(x * x + y_ * y_)


@ready_made()
def hill(*, x=0.3, y=0.0, vx=0.0, vy=1.5, t1=10.0) -> Scene:
    """Hill's problem: a moon of no mass about a planet that circles the Sun.

    Its two equilibria are at x = 3^(-1/3) and -3^(-1/3), where Jacobi's constant is 3^(4/3). Hill
    (1878), American Journal of Mathematics 1, 5; Henon (1969), Astronomy and Astrophysics 1, 223.

    Args:
      x: at the start, away from the Sun [1]; lengths are in units of the distance of the Sun times
        the cube root of the planet's share of the mass.
      y: at the start, along the planet's motion [1].
      vx: at the start, in the turning axes [1].
      vy: at the start, in the turning axes [1].
      t1: span [1]; the planet circles the Sun once in 2 pi.
    """
    return Scene(Hill(), y0=jnp.stack([x, y, vx, vy]), t1=t1)
