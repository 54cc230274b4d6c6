"""A disk that touches the ground at its lowest point, in Euler angles: course problem 60."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn._numerics import nan_unless, smooth
from jaxdyn.formulations.mechanism import Mechanism
from jaxdyn.formulations.rigid import Pose
from jaxdyn.geometry.euler import matrix_from_euler, omega_b_from_euler
from jaxdyn.joints import Joint, along, body
from jaxdyn.sketch import Shape, arc, lines, traces

_SEQUENCE = "ZXZ"
_SPOKES = ((0, 1), (2, 3))
_RIM = ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))

#: Sine of the angle between the axis and the vertical below which a disk lies flat. There the rates
#: of phi and psi cancel; their rounding error, 1e-16 over the square of the sine, calls for ever
#: smaller steps.
FLAT = 1e-4


@smooth  # its condition matters only where there is no motion
def _above_flat(height: Array) -> Array:
    """The height, or NaN beyond flat, where the disk would continue below the ground."""
    return nan_unless(height > FLAT, height)


class Disk(Mechanism):
    """A flat disk with moments I_1, I_1, 2 I_1, held on the plane z = 0 by its lowest point.

    The contact is bilateral, so a motion that would lift the disk has a negative normal force. This
    force is the first of `Constrained.constraint_forces`; on a rough plane the x and y components
    of the friction follow.

    Attributes:
      m: () mass [kg].
      radius: () radius [m].
      I1: () moment about a diameter [kg m^2]: m r^2 / 4 for a uniform disk, m r^2 / 2 for a hoop.
      rough: whether it rolls without slip; otherwise there is no friction.
    """

    m: Array = eqx.field(converter=as_float)
    radius: Array = eqx.field(converter=as_float)
    I1: Array = eqx.field(converter=as_float)
    rough: bool = eqx.field(static=True, default=True, kw_only=True)
    singular: ClassVar[str] = (
        "The disk falls flat on the ground, and its impact is not part of the scene. End the span "
        "before, or start with more precession or spin."
    )

    def coordinates(self):
        lengths = (("x", "m"), ("y", "m"), ("z", "m"))
        return (*lengths, ("phi", "rad"), ("theta", "rad"), ("psi", "rad"))

    def masses(self):
        return jnp.broadcast_to(self.m / len(_RIM), (len(_RIM),))

    def positions(self, t, q):
        del t
        gyration = jnp.sqrt(2 * self.I1 / self.m)
        R = matrix_from_euler(q[3:], _SEQUENCE)
        arms = [gyration * (x * R[:, 0] + y * R[:, 1]) for x, y, _ in _RIM]
        return q[None, :3] + jnp.stack(arms)

    def constraints(self, t, q):
        del t
        height = jnp.sin(q[4])
        return (q[2] - self.radius * _above_flat(height))[None]

    def rolling(self, t, q):
        """(2, 6) the rows of the velocity of the disk's contact point along x and y.

        That velocity is v + omega x c with c = -r e_y'; the horizontal part of omega x c is
        (omega_p cos(theta) + omega_s) r e_x' plus (d theta/dt) r sin(theta) along the horizontal
        k x e_x'.
        """
        del t
        if not self.rough:
            return None
        c, s = jnp.cos(q[3]), jnp.sin(q[3])
        cos, sin, r = jnp.cos(q[4]), jnp.sin(q[4]), self.radius
        one, zero = jnp.ones_like(c), jnp.zeros_like(c)
        along_x = [one, zero, zero, r * cos * c, -r * sin * s, r * c]
        along_y = [zero, one, zero, r * cos * s, r * sin * c, r * s]
        return jnp.stack([jnp.stack(along_x), jnp.stack(along_y)])

    def sketch(self, t, q):
        """The rim with two spokes, the contact point and its path."""
        del t
        R = matrix_from_euler(q[3:], _SEQUENCE)
        across, up = self.radius * R[:, 0], self.radius * R[:, 1]
        rim = Shape("area", arc(q[:3], across, up))
        spokes = lines(jnp.stack([q[:3] + across, q[:3] - across, q[:3] + up, q[:3] - up]), _SPOKES)
        marks = jnp.stack([self.contact(q), q[:3]])
        return rim, spokes, *traces(marks, ["contact with the ground", "centre"])

    def bodies(self, t, q):
        del t, q
        return body("disk", self.masses())

    def joints(self, t, q):
        del t
        place, axes = self.contact(q), jnp.asarray(np.eye(3))
        normal = along("normal force", 0, None, place, axes[2], 0)
        return (normal, Joint("friction", 0, None, place, axes[:2], 1)) if self.rough else (normal,)

    def pose(self, q: Array, v: Array) -> Pose:
        """The position, attitude and angular velocity for coordinates and velocities (6,)."""
        omega_b = omega_b_from_euler(q[3:], _SEQUENCE) @ v[3:]
        return Pose(r=q[:3], R_wb=matrix_from_euler(q[3:], _SEQUENCE), v=v[:3], omega_b=omega_b)

    def contact(self, q: Array) -> Array:
        """(3,) the contact point."""
        unspun = jnp.stack([q[3], q[4], jnp.zeros_like(q[5])])
        uphill = matrix_from_euler(unspun, _SEQUENCE)[:, 1]
        return q[:3] - self.radius * uphill

    def check(self):
        for name in ("m", "radius", "I1"):
            _checks.positive(name, getattr(self, name), "In kg, m and kg m^2.")
