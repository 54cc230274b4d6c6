"""One stick in the plane, on a fixed or shaking hinge or on a cart: by angles, and with a rod.

x points right, y up. Every machine comes twice: by free coordinates, and in cartesian ones with
the length of the stick as the tie, whose multiplier is the force along it.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.formulations.mechanism import Mechanism


class Stick(Mechanism):
    """A stick on a hinge, by its angle; a uniform one, or a point mass at its end.

    Attributes:
      m: () mass [kg].
      l: () length [m].
      amplitude: () of the hinge [m]; None where it stands still.
      frequency: () of the hinge [rad/s]; None where it stands still.
      inverted: the angle is from straight up, clockwise; else from hanging, counterclockwise.
      uniform: a uniform stick.
    """

    m: Array
    l: Array  # noqa: E741 the course's name
    amplitude: Array | None = None
    frequency: Array | None = None
    inverted: bool = eqx.field(static=True, default=False)
    uniform: bool = eqx.field(static=True, default=False)

    def coordinates(self):
        return (("theta", "rad"),)

    def masses(self):
        return _stick_masses(self.m, self.uniform)

    def positions(self, t, q):
        return _stick_points(self.base(t), self.end(t, q), self.uniform)

    def base(self, t: Array) -> Array:
        """(2,) where the hinge is."""
        return _base(t, self.amplitude, self.frequency)

    def end(self, t: Array, q: Array) -> Array:
        """(2,) where the far end is: its coordinates as a `TiedStick`."""
        up = 1.0 if self.inverted else -1.0
        return self.base(t) + self.l * jnp.stack([jnp.sin(q[0]), up * jnp.cos(q[0])])

    def links(self):
        return _stick_links(self.uniform, self.amplitude is None)

    def check(self):
        _checks.positive("length", self.l, "Lengths are in m.")


class TiedStick(Mechanism):
    """The same stick by x and y of its far end, with its length as the tie."""

    m: Array
    l: Array  # noqa: E741 the course's name
    amplitude: Array | None = None
    frequency: Array | None = None
    uniform: bool = eqx.field(static=True, default=False)

    def coordinates(self):
        return (("x", "m"), ("y", "m"))

    def masses(self):
        return _stick_masses(self.m, self.uniform)

    def positions(self, t, q):
        # Points of a straight line stay on it, so the far end says where all of them are.
        return _stick_points(_base(t, self.amplitude, self.frequency), q, self.uniform)

    def tied(self, t, q):
        x, y = q - _base(t, self.amplitude, self.frequency)
        return (jnp.sqrt(x * x + y * y) - self.l)[None]

    def links(self):
        return _stick_links(self.uniform, self.amplitude is None)

    def check(self):
        _checks.positive("length", self.l, "Lengths are in m.")


class Sideways(Mechanism):
    """A point mass on a rod, by one of its cartesian coordinates: hanging, by its x.

    Attributes:
      m: () mass [kg].
      l: () length [m].
      axis: of the coordinate, 0 for x and 1 for y.
      side: () sign of the other one, which the coordinate does not tell.
    """

    m: Array
    l: Array  # noqa: E741 the course's name
    axis: int = eqx.field(static=True, default=0)
    side: Array | float = -1.0

    def coordinates(self):
        return (("xy"[self.axis], "m"),)

    def masses(self):
        return self.m[None]

    def positions(self, t, q):
        del t
        both = [q[0], self.side * jnp.sqrt(self.l**2 - q[0] ** 2)]
        return jnp.stack(both[:: -1 if self.axis else 1])[None, :]

    def links(self):
        return _stick_links(False, True)

    def check(self):
        _checks.positive("length", self.l, "Lengths are in m.")


class Cart(Mechanism):
    """A cart and a point mass on a stick, by the cart's x and the stick's angle."""

    m: Array
    l: Array  # noqa: E741 the course's name

    def coordinates(self):
        return (("x", "m"), ("theta", "rad"))

    def masses(self):
        return self.m

    def positions(self, t, q):
        return _cart_points(self.loose(t, q))

    def loose(self, t: Array, q: Array) -> Array:
        """(3,) the cart's x and the point's x and y: the coordinates of a `TiedCart`."""
        del t
        x, angle = q
        return jnp.stack([x, x + self.l * jnp.sin(angle), -self.l * jnp.cos(angle)])

    def links(self):
        return ((0, 1),)

    def check(self):
        _checks.positive("length", self.l, "Lengths are in m.")


class TiedCart(Mechanism):
    """The same by the cart's x and the point's x and y, with the stick's length as the tie."""

    m: Array
    l: Array  # noqa: E741 the course's name

    def coordinates(self):
        return (("x", "m"), ("x2", "m"), ("y2", "m"))

    def masses(self):
        return self.m

    def positions(self, t, q):
        del t
        return _cart_points(q)

    def tied(self, t, q):
        del t
        x = q[1] - q[0]
        return (jnp.sqrt(x * x + q[2] * q[2]) - self.l)[None]

    def links(self):
        return ((0, 1),)

    def check(self):
        _checks.positive("length", self.l, "Lengths are in m.")


def _base(t: Array, amplitude: Array | None, frequency: Array | None) -> Array:
    if amplitude is None or frequency is None:
        return jnp.zeros(2)
    y = -amplitude * jnp.cos(frequency * t)
    return jnp.stack([jnp.zeros_like(y), y])


def _stick_masses(m: Array, uniform: bool) -> Array:
    """A point at the end, or Simpson's three points of a uniform stick; see `bars`."""
    return m * jnp.array([1 / 6, 4 / 6, 1 / 6]) if uniform else m[None]


def _stick_points(base: Array, end: Array, uniform: bool) -> Array:
    return jnp.stack([base, 0.5 * (base + end), end]) if uniform else end[None, :]


def _stick_links(uniform: bool, still: bool) -> tuple[tuple, ...]:
    if uniform:
        return ((0, 2),)
    # The hinge of a point mass is no material point; a drawing can join it while it rests.
    return (((0.0, 0.0), 0),) if still else ()


def _cart_points(xs: Array) -> Array:
    x, x2, y2 = xs
    return jnp.stack([jnp.stack([x, jnp.zeros_like(x)]), jnp.stack([x2, y2])])
