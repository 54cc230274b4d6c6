"""One stick in the plane, on a fixed or shaking hinge or on a cart: in its angle or with a tie.

x points right, y up. Each mechanism has two descriptions: in free coordinates, and in cartesian
ones with the length of the stick as a tie, whose multiplier is the force along the stick.
"""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.formulations.mechanism import Mechanism, stretch
from jaxdyn.joints import Joint, along, body, particles, pinned, rod
from jaxdyn.sketch import Shape, line, pin, rectangle, traces

_ACROSS = np.array([1.0, 0.0])


class _OnHinge(Mechanism):
    """A stick on a hinge, in any coordinates.

    Attributes:
      m: () mass [kg].
      l: () length [m].
      amplitude: () amplitude of the hinge [m]; None if it is fixed.
      frequency: () frequency of the hinge [rad/s]; None if it is fixed.
      phase: () phase of the hinge [rad], whose height is -amplitude cos(frequency t + phase).
      uniform: whether the stick is uniform; otherwise its mass is a point at its end.
    """

    m: Array
    l: Array  # noqa: E741 the course's name
    amplitude: Array | None = None
    frequency: Array | None = None
    phase: Array | float = 0.0
    uniform: bool = eqx.field(static=True, default=False)

    @abc.abstractmethod
    def end(self, t: Array, q: Array) -> Array:
        """(2,) the position of the far end: the coordinates of a `TiedStick`."""

    def base(self, t: Array) -> Array:
        """(2,) the position of the hinge."""
        if self.amplitude is None or self.frequency is None:
            return jnp.zeros(2)
        y = -self.amplitude * jnp.cos(self.frequency * t + self.phase)
        return jnp.stack([jnp.zeros_like(y), y])

    def masses(self):
        # The mass is a point at the end, or Simpson's three points of a uniform stick; see `bars`.
        return self.m * np.array([1 / 6, 4 / 6, 1 / 6]) if self.uniform else self.m[None]

    def positions(self, t, q):
        # The points stay on a straight line, so the far end determines all of them.
        base, end = self.base(t), self.end(t, q)
        return jnp.stack([base, 0.5 * (base + end), end]) if self.uniform else end[None, :]

    def bodies(self, t, q):
        if not self.uniform:
            return particles(self.masses(), ("mass",))
        return body("stick", self.masses(), (line(self.base(t), self.end(t, q)),))

    def joints(self, t, q):
        if self.uniform:
            return (pinned("hinge", 0, None, self.base(t)),)
        return (self._rod(t, q),)

    def _rod(self, t: Array, q: Array) -> Joint:
        return rod("stick", 0, None, (self.base(t), self.end(t, q)))

    def sketch(self, t, q):
        base, end = self.base(t), self.end(t, q)
        mark = traces(end[None], [""])
        if self.amplitude is None:
            return line(base, end), pin(base), *mark
        block = rectangle("area", (0.2 * self.l, 0.1 * self.l), (0.0, -0.05 * self.l))
        return line(base, end), block.place(base, jnp.eye(2)), *mark

    def check(self):
        _checks.positive("length", self.l, "Lengths are in m.")


class Stick(_OnHinge):
    """A stick on a hinge, described by its angle, counterclockwise from hanging.

    Attributes:
      inverted: whether the angle is measured clockwise from straight up.
    """

    inverted: bool = eqx.field(static=True, default=False)

    def coordinates(self):
        return (("theta", "rad"),)

    def end(self, t, q):
        up = 1.0 if self.inverted else -1.0
        return self.base(t) + self.l * jnp.stack([jnp.sin(q[0]), up * jnp.cos(q[0])])


class TiedStick(_OnHinge):
    """The same stick described by x and y of its far end, with its length as the tie.

    Attributes:
      squared: whether the tie is on the squared length; see `mechanism.stretch`.
    """

    squared: bool = eqx.field(static=True, default=False)

    def coordinates(self):
        return (("x", "m"), ("y", "m"))

    def end(self, t, q):
        del t
        return q

    def constraints(self, t, q):
        x, y = q - self.base(t)
        return stretch(x * x + y * y, self.l, self.squared)[None]

    def _rod(self, t, q):
        return super()._rod(t, q)._replace(multiplier=0)

    def rods(self):
        return ("stick",)


class Sideways(Mechanism):
    """A point mass on a rod, described by one cartesian coordinate, such as x near hanging.

    Attributes:
      m: () mass [kg].
      l: () length [m].
      axis: axis of the coordinate, 0 for x and 1 for y.
      side: () sign of the other coordinate, which is not determined by this one.
    """

    m: Array
    l: Array  # noqa: E741 the course's name
    axis: int = eqx.field(static=True, default=0)
    singular: ClassVar[str] = (
        "At the level of the hinge the coordinate does not determine how the mass continues: "
        "scenes.sideways_edge says when it gets there; continue with scenes.pendulum."
    )
    side: Array | float = -1.0

    def coordinates(self):
        return (("xy"[self.axis], "m"),)

    def masses(self):
        return self.m[None]

    def positions(self, t, q):
        del t
        both = [q[0], self.side * jnp.sqrt(self.l**2 - q[0] ** 2)]
        return jnp.stack(both[:: -1 if self.axis else 1])[None, :]

    def bodies(self, t, q):
        del t, q
        return particles(self.masses(), ("mass",))

    def joints(self, t, q):
        r = self.positions(t, q)[0]
        return (rod("stick", 0, None, (jnp.zeros(2), r)),)

    def sketch(self, t, q):
        return line(jnp.zeros(2), self.positions(t, q)[0]), pin(jnp.zeros(2))

    def check(self):
        _checks.positive("length", self.l, "Lengths are in m.")


class _OnCart(Mechanism):
    """A cart and a point on a stick, in any coordinates.

    Attributes:
      m: (2,) masses of the cart and of the point [kg].
      l: () length of the stick [m].
    """

    m: Array
    l: Array  # noqa: E741 the course's name

    @abc.abstractmethod
    def cartesian(self, t: Array, q: Array) -> Array:
        """(3,) x of the cart and x and y of the point: the coordinates of a `TiedCart`."""

    def masses(self):
        return self.m

    def positions(self, t, q):
        x, x2, y2 = self.cartesian(t, q)
        return jnp.stack([jnp.stack([x, jnp.zeros_like(x)]), jnp.stack([x2, y2])])

    def bodies(self, t, q):
        cart, mass = particles(self.m, ("cart", "mass"))
        block = rectangle("area", (0.3 * self.l, 0.12 * self.l))
        block = block.place(self.positions(t, q)[0], jnp.eye(2))
        return cart._replace(outline=(block,)), mass

    def joints(self, t, q):
        r = self.positions(t, q)
        track = along("track", 0, None, r[0], jnp.asarray(_ACROSS[::-1]))
        return rod("stick", 1, 0, (r[0], r[1]), self._multiplier), track

    @property
    def _multiplier(self) -> int | None:
        return None

    def sketch(self, t, q):
        r = self.positions(t, q)
        body = rectangle("area", (0.3 * self.l, 0.12 * self.l))
        track = line(r[0] - 0.3 * self.l * _ACROSS, r[0] + 0.3 * self.l * _ACROSS)
        low = jnp.stack([0 * self.l, -0.06 * self.l])
        track = Shape("ground", track.at + low[None])
        cart = body.place(r[0], jnp.eye(2))
        return track, cart, line(*r), *traces(r, ["cart", "mass"])

    def check(self):
        _checks.positive("length", self.l, "Lengths are in m.")


class Cart(_OnCart):
    """A cart and a point mass on a stick, described by the cart's x and the stick's angle."""

    def coordinates(self):
        return (("x", "m"), ("theta", "rad"))

    def cartesian(self, t, q):
        del t
        x, angle = q
        return jnp.stack([x, x + self.l * jnp.sin(angle), -self.l * jnp.cos(angle)])


class TiedCart(_OnCart):
    """The same in x of the cart and x and y of the point, with the length of the stick as tie."""

    def coordinates(self):
        return (("x", "m"), ("x2", "m"), ("y2", "m"))

    def cartesian(self, t, q):
        del t
        return q

    def constraints(self, t, q):
        del t
        x = q[1] - q[0]
        return stretch(x * x + q[2] * q[2], self.l, squared=False)[None]

    @property
    def _multiplier(self):
        return 0

    def rods(self):
        return ("stick",)
