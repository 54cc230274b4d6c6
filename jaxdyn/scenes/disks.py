"""A disk that rolls or slides on a plane: course problem 60.

The lean theta is the angle between the disk's axis e_3' and the vertical, pi/2 for an upright disk;
the course calls it theta in the picture and phi in the question. The precession
omega_p is about the vertical, the spin omega_s (the course's "pitch rate") about e_3', so
omega = omega_p k + (d theta/dt) e_x' + omega_s e_3' with e_x' the horizontal k x e_3'.
Its steady motions are `precession.rolling_disk_circle` and its neighbours.
"""

import math
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._floats import as_float, floats
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.formulations.mechanism import Mechanism
from jaxdyn.formulations.rigid import Pose
from jaxdyn.geometry.euler import matrix_from_euler, omega_b_from_euler
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import ready_made
from jaxdyn.sketch import Shape, arc, lines, traces

_SEQUENCE = "ZXZ"
_SPOKES = ((0, 1), (2, 3))
_RIM = ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))


#: Sine of the angle between the axis and the vertical below which a disk lies flat. The rates of
#: phi and psi cancel there: their rounding, 1e-16 over its square, calls for ever smaller steps.
_FLAT = 1e-4


class Disk(Mechanism):
    """A flat disk with moments I_1, I_1, 2 I_1, held on the plane z = 0 by its lowest point.

    The contact is bilateral, so a motion that would lift the disk has a negative normal force. That
    is the first of `Constrained.constraint_forces`; on a rough plane the x and y components of
    the friction follow.

    Attributes:
      m: () mass [kg].
      radius: () [m].
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

    def tied(self, t, q):
        del t
        height = jnp.sin(q[4])
        # Beyond flat the disk would go on below the ground. A factor, not a choice: the derivatives
        # of a choice of NaN are 0.
        height = height * jnp.where(height > _FLAT, 1.0, jnp.nan)
        return (q[2] - self.radius * height)[None]

    def rolling(self, t, q):
        """(2, 6) rows of the velocity of the disk's contact point, along x and y.

        It is v + omega x c with c = -r e_y', horizontally (omega_p cos(theta) + omega_s) r e_x'
        plus (d theta/dt) r sin(theta) along the horizontal k x e_x'.
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

    def pose(self, q: Array, v: Array) -> Pose:
        """Position, attitude and angular velocity at coordinates and velocities (6,)."""
        omega_b = omega_b_from_euler(q[3:], _SEQUENCE) @ v[3:]
        return Pose(r=q[:3], R_wb=matrix_from_euler(q[3:], _SEQUENCE), v=v[:3], omega_b=omega_b)

    def contact(self, q: Array) -> Array:
        """(3,) the contact point."""
        uphill = matrix_from_euler(q[3:].at[2].set(0.0), _SEQUENCE)[:, 1]
        return q[:3] - self.radius * uphill

    def check(self):
        for name in ("m", "radius", "I1"):
            _checks.positive(name, getattr(self, name), "In kg, m and kg m^2.")


@ready_made()
def rolling_disk(
    theta=1.2,
    *,
    precession=2.0,
    lean_rate=0.0,
    spin=3.0,
    m=1.0,
    radius=0.5,
    I1=None,
    g=9.81,
    rough: bool = True,
    t1=10.0,
) -> Scene:
    """A disk that rolls without slip, or slides without friction, on level ground (problem 60).

    A motion ends with a status where the disk comes within 1e-4 rad of lying flat.

    Args:
      theta: angle of the axis to the vertical, pi/2 upright [rad]; not 0, flat on the plane.
      precession: rate about the vertical [rad/s].
      lean_rate: rate of theta [rad/s].
      spin: about the axis, relative to the frame that precesses [rad/s].
      m: mass [kg].
      radius: [m].
      I1: moment about a diameter, half of that about the axis [kg m^2]; uniform if left out.
      g: gravity [m/s^2].
      rough: whether it rolls; otherwise it slides, and its centre starts with a vertical velocity.
      t1: span [s].
    """
    if not _checks.is_traced(theta) and not math.sin(theta) > _FLAT:
        wanted = "a disk that does not lie flat, 0 < theta < pi"
        raise _checks.fail("theta", wanted, theta, "A disk that lies flat has no lowest point.")
    I1 = m * radius**2 / 4 if I1 is None else I1
    disk = Disk(m, radius, I1, rough=rough)
    theta, precession, lean_rate, spin, radius = floats(theta, precession, lean_rate, spin, radius)
    zero = jnp.zeros(())
    angles, rates = [zero, theta, zero], [precession, lean_rate, spin]
    # Rolling along x at phi = 0, by `Disk.rolling` and `Disk.tied`.
    v = [-radius * (precession * jnp.cos(theta) + spin), -radius * jnp.sin(theta) * lean_rate]
    v = v if rough else [zero, zero]
    up = radius * jnp.sin(theta), radius * jnp.cos(theta) * lean_rate
    y0 = jnp.stack([zero, zero, up[0], *angles, *v, up[1], *rates])
    return Scene(Constrained(disk), (UniformGravity(g),), y0=y0, t1=t1)
