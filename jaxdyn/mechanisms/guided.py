"""Masses guided by wires, slots and machinery, in the plane: the mechanisms of `scenes.guides`."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.formulations.mechanism import Mechanism, planar_body
from jaxdyn.joints import Part, along, particles, pinned
from jaxdyn.sketch import Shape, circle, line, lines, pin, traces

#: Ratio of the radius of a table to its radius of gyration.
_RIM_RATIO = 1.5
#: The masses of a plate, and the pairs of them that the plate joins.
_DRIVEN = ("driven 1", "driven 2", "fixed 1", "fixed 2")
_PLATE = ((0, 1), (2, 3))


#: Number of points of a drawn wire.
_CORNERS = 61


def _parabola(c: Array, x: Array) -> Shape:
    """The wire y = c x^2, to beyond the bead and beyond a slope of 2."""
    size = jnp.abs(c)
    far = 1.1 * jnp.maximum(jnp.abs(x), 1 / jnp.where(size > 0, size, 1.0))
    corners = far * np.linspace(-1.0, 1.0, _CORNERS)
    return Shape("ground", jnp.stack([corners, c * corners**2], axis=1))


class Parabola(Mechanism):
    """A bead on the wire y = c x^2, described by its x.

    Attributes:
      m: () mass [kg].
      c: () half of the curvature of the wire at the bottom [1/m].
    """

    m: Array
    c: Array

    def coordinates(self):
        return (("x", "m"),)

    def masses(self):
        return self.m[None]

    def positions(self, t, q):
        return self.place(t, q)[None, :]

    def bodies(self, t, q):
        del t, q
        return particles(self.m[None], ("bead",))

    def joints(self, t, q):
        slope = 2 * self.c * q[0]
        normal = jnp.stack([-slope, jnp.ones_like(slope)])
        return (along("wire", 0, None, self.place(t, q), normal),)

    def sketch(self, t, q):
        del t
        return (_parabola(self.c, q[0]),)

    def place(self, t: Array, q: Array) -> Array:
        """(2,) x and y: the coordinates of a `TiedParabola`."""
        del t
        return jnp.stack([q[0], self.c * q[0] ** 2])


class TiedParabola(Mechanism):
    """The same bead in x and y, tied to the wire; the multiplier pushes along (-2 c x, 1).

    Attributes:
      m: () mass [kg].
      c: () half of the curvature of the wire at the bottom [1/m].
    """

    m: Array
    c: Array

    def coordinates(self):
        return (("x", "m"), ("y", "m"))

    def masses(self):
        return self.m[None]

    def positions(self, t, q):
        del t
        return q[None, :]

    def bodies(self, t, q):
        del t, q
        return particles(self.m[None], ("bead",))

    def joints(self, t, q):
        del t
        slope = 2 * self.c * q[0]
        normal = jnp.stack([-slope, jnp.ones_like(slope)])
        return (along("wire", 0, None, q, normal, 0),)

    def constraints(self, t, q):
        del t
        return (q[1] - self.c * q[0] ** 2)[None]

    def sketch(self, t, q):
        del t
        return (_parabola(self.c, q[0]),)


class Cycloid(Mechanism):
    """A bead on the wire y = c s^2, described by the arc length s along it.

    Attributes:
      m: () mass [kg].
      c: () half of the curvature of the wire at the bottom [1/m].
    """

    m: Array
    c: Array
    singular: ClassVar[str] = "The wire ends upright, 1 / (2 c) along it from the bottom."

    def coordinates(self):
        return (("s", "m"),)

    def masses(self):
        return self.m[None]

    def positions(self, t, q):
        del t
        return self._wire(q)

    def _wire(self, s: Array) -> Array:
        """(n, 2) places at lengths s (n,) along the wire."""
        slope = 2 * self.c * s
        # The integral of cos(arcsin(slope)) over s; the curve ends where arcsin does.
        x = 0.5 * (s * jnp.sqrt(1 - slope * slope) + jnp.arcsin(slope) / (2 * self.c))
        return jnp.stack([x, self.c * s * s], axis=1)

    def sketch(self, t, q):
        del t, q
        return (Shape("ground", self._wire(np.linspace(-1.0, 1.0, _CORNERS) / (2 * self.c))),)

    def bodies(self, t, q):
        del t, q
        return particles(self.m[None], ("bead",))

    def joints(self, t, q):
        slope = 2 * self.c * q[0]
        normal = jnp.stack([-slope, jnp.sqrt(1 - slope * slope)])
        return (along("wire", 0, None, self.positions(t, q)[0], normal),)

    def check(self):
        _checks.positive("c", self.c, "The curve bends upwards.")


class Turntable(Mechanism):
    """A mass in a straight slot of a table that turns about the origin, described by theta and s.

    Attributes:
      m: () sliding mass [kg].
      m_table: () mass of the table [kg].
      inertia: () moment of inertia of the table about its centre [kg m^2].
      d: () distance of the slot from the centre [m].
    """

    m: Array
    m_table: Array
    inertia: Array
    d: Array

    def coordinates(self):
        return (("theta", "rad"), ("s", "m"))

    def masses(self):
        half = 0.5 * self.m_table
        return jnp.stack([self.m, half, half])

    def positions(self, t, q):
        del t
        theta, s = q
        c, n = jnp.cos(theta), jnp.sin(theta)
        mass = jnp.stack([s * c + self.d * n, s * n - self.d * c])
        table = planar_body(jnp.zeros(2), theta, jnp.sqrt(self.inertia / self.m_table))
        return jnp.concatenate([mass[None, :], table])

    def bodies(self, t, q):
        table, slot = self.sketch(t, q)[:2]
        (mass,) = particles(self.m[None], ("mass",))
        half = 0.5 * self.m_table
        return mass, Part("table", (1, 2), jnp.stack([half, half]), True, (table, slot))

    def joints(self, t, q):
        across = jnp.stack([-jnp.sin(q[0]), jnp.cos(q[0])])
        slot = along("slot", 0, 1, self.positions(t, q)[0], across)
        return slot, pinned("pin", 1, None, jnp.zeros(2))

    def sketch(self, t, q):
        r = self.positions(t, q)
        radius = jnp.sqrt(self.inertia / self.m_table)
        c, n = jnp.cos(q[0]), jnp.sin(q[0])
        along, middle = jnp.stack([c, n]), self.d * jnp.stack([n, -c])
        rim = _RIM_RATIO * radius
        # The slot is drawn from rim to rim, or as far as the mass has come.
        half = jnp.sqrt(jnp.maximum(rim**2 - self.d**2, 0.0))
        low, high = jnp.minimum(-half, q[1]), jnp.maximum(half, q[1])
        slot = line(middle + low * along, middle + high * along)
        table = Shape("area", circle(jnp.zeros(2), rim))
        return table, slot, pin(jnp.zeros(2)), *traces(r[:1], ["mass"])

    def check(self):
        _checks.positive("inertia", self.inertia, "Inertias are in kg m^2.")


class Plate(Mechanism):
    """A massless plate with two masses fixed to it and two driven on circles, in the plate's angle.

    Attributes:
      m: () mass of each [kg].
      weld: () distance of the fixed ones from the middle [m].
      centre: () distance of the circles' centres from the middle [m].
      radius: () radius of the circles [m].
    """

    m: Array
    weld: Array
    centre: Array
    radius: Array

    def coordinates(self):
        return (("phi", "rad"),)

    def masses(self):
        return jnp.broadcast_to(self.m, (4,))

    def positions(self, t, q):
        c, s = jnp.cos(q[0]), jnp.sin(q[0])
        driven = (1 - jnp.cos(t)) * jnp.pi
        x = self.centre + self.radius * jnp.cos(driven)
        y = self.radius * jnp.sin(driven)
        moving = jnp.stack([c * x - s * y, s * x + c * y])
        fixed = self.weld * jnp.stack([-s, c])
        return jnp.stack([moving, -moving, fixed, -fixed])

    def bodies(self, t, q):
        r = self.positions(t, q)
        plate = Part("plate", (), jnp.zeros(0), True, (lines(r, _PLATE),), jnp.zeros(2))
        return *particles(self.masses(), _DRIVEN), plate

    def joints(self, t, q):
        r = self.positions(t, q)
        grips = (pinned(f"grip of {name}", i, 4, r[i]) for i, name in enumerate(_DRIVEN))
        return *grips, pinned("pin", 4, None, jnp.zeros(2))

    def sketch(self, t, q):
        r = self.positions(t, q)
        c, n = jnp.cos(q[0]), jnp.sin(q[0])
        centre = self.centre * jnp.stack([c, n])
        rings = (Shape("ground", circle(side * centre, self.radius)) for side in (1.0, -1.0))
        return *rings, lines(r, _PLATE), pin(jnp.zeros(2)), *traces(r, _DRIVEN)

    def check(self):
        _checks.positive("weld", self.weld, "Distances are in m.")
