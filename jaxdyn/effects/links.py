"""Springs, dashpots and dampers between two points, or a point and an anchor; dampers in hinges.

Springs and dashpots act along the line between their ends. Where the ends coincide the line has no
direction and the force is zero, except that a spring of rest length 0 is linear, -k r, throughout.
"""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, floats
from jaxdyn._numerics import safe_norm, square_norm
from jaxdyn.effects._parts import (
    at_least_zero,
    end_of,
    is_index,
    on_ends,
    point_number,
    sums_at,
    vector_or_zero,
)
from jaxdyn.scene import Effect, Points
from jaxdyn.sketch import Kind, Shape, pin

_NO_DIRECTION = (
    "A spring or dashpot has no direction where its ends coincide: its force jumps there."
)
_ONE_ANGLE = "Leave j out for a damper between a bar and the ground."


class Spring(Effect):
    """A linear spring with energy k (l - length)^2 / 2, l being the distance of its ends.

    It goes from point i to point j or, where j is None, to an anchor.

    Attributes:
      k: () stiffness [N/m].
      length: () rest length, which may be 0 [m].
      anchor: (d,) position of the anchor, or 0 for the origin [m].
    """

    k: Array = eqx.field(converter=as_float)
    length: Array = eqx.field(converter=as_float, default=0.0)
    anchor: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    i: int = eqx.field(static=True, default=0, kw_only=True)
    j: int | None = eqx.field(static=True, default=None, kw_only=True)
    velocity_dependent: ClassVar[bool] = False
    singular: ClassVar[str] = _NO_DIRECTION

    def potential(self, t, r, m):
        del t, m
        return _energy(self.k, self.length, r[self.i] - end_of(r, self.j, self.anchor))

    def force(self, t, r, v, m):
        del t, v, m
        d = r[self.i] - end_of(r, self.j, self.anchor)
        # It is written with the unit vector, whose bounds are known at every length: proofs about
        # equilibria need them.
        pull = self.k * (d - self.length * _direction(d))
        return on_ends(-pull, r.shape[0], self.i, self.j)

    def sketch(self, t, r):
        del t
        return _sketch("spring", r, self.i, self.j, self.anchor)

    def check(self, points: Points) -> None:
        _check_ends(self.i, self.j, len(points.m))
        vector_or_zero("anchor", self.anchor, points.r.shape[1])
        at_least_zero("length", self.length, "A rest length is in m.")
        _checks.array("k", self.k, (), "A stiffness is in N/m.")


class Dashpot(Effect):
    """A damper -c dl/dt along the line between its ends, l being their distance.

    It goes from point i to point j or, where j is None, to an anchor.

    Attributes:
      c: () damping coefficient [kg/s].
      anchor: (d,) position of the anchor, or 0 for the origin [m].
    """

    c: Array = eqx.field(converter=as_float)
    anchor: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    i: int = eqx.field(static=True, default=0, kw_only=True)
    j: int | None = eqx.field(static=True, default=None, kw_only=True)
    singular: ClassVar[str] = _NO_DIRECTION

    def force(self, t, r, v, m):
        del t, m
        along = _direction(r[self.i] - end_of(r, self.j, self.anchor))
        opening = jnp.sum(along * (v[self.i] - end_of(v, self.j, jnp.zeros(()))))
        return on_ends(-self.c * opening * along, r.shape[0], self.i, self.j)

    def sketch(self, t, r):
        del t
        return _sketch("dashpot", r, self.i, self.j, self.anchor)

    def check(self, points: Points) -> None:
        _check_ends(self.i, self.j, len(points.m))
        vector_or_zero("anchor", self.anchor, points.r.shape[1])
        _checks.array("c", self.c, (), "A damping coefficient is in kg/s.")


class CubicSpring(Effect):
    """A spring with energy beta l^4 / 4, l being the distance of its ends: it pulls with beta l^3.

    It goes from point i to point j or, where j is None, to an anchor.

    Attributes:
      beta: () cubic stiffness, negative for a spring that softens [N/m^3].
      anchor: (d,) position of the anchor, or 0 for the origin [m].
    """

    beta: Array = eqx.field(converter=as_float)
    anchor: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    i: int = eqx.field(static=True, default=0, kw_only=True)
    j: int | None = eqx.field(static=True, default=None, kw_only=True)
    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        del t, m
        square = square_norm(r[self.i] - end_of(r, self.j, self.anchor))
        return 0.25 * self.beta * square * square

    def force(self, t, r, v, m):
        del t, v, m
        d = r[self.i] - end_of(r, self.j, self.anchor)
        return on_ends(-self.beta * square_norm(d) * d, r.shape[0], self.i, self.j)

    def sketch(self, t, r):
        del t
        return _sketch("spring", r, self.i, self.j, self.anchor)

    def check(self, points: Points) -> None:
        _check_ends(self.i, self.j, len(points.m))
        vector_or_zero("anchor", self.anchor, points.r.shape[1])
        _checks.array("beta", self.beta, (), "The coefficient of a cubic spring is in N/m^3.")


class Damper(Effect):
    """Viscous damping -c dr/dt in all directions, r being the difference of the ends' positions.

    It goes from point i to point j or, where j is None, to a support. A `Dashpot` damps only
    changes of the distance.

    Attributes:
      c: () damping coefficient [kg/s].
      velocity: (d,) velocity of the support, or 0 [m/s].
    """

    c: Array = eqx.field(converter=as_float)
    velocity: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    i: int = eqx.field(static=True, default=0, kw_only=True)
    j: int | None = eqx.field(static=True, default=None, kw_only=True)

    def force(self, t, r, v, m):
        del t, m
        apart = v[self.i] - end_of(v, self.j, self.velocity)
        return on_ends(-self.c * apart, r.shape[0], self.i, self.j)

    def check(self, points: Points) -> None:
        _check_ends(self.i, self.j, len(points.m))
        vector_or_zero("velocity", self.velocity, points.r.shape[1])
        _checks.array("c", self.c, (), "A damping coefficient is in kg/s.")


class HingeDamper(Effect):
    """A damper in a hinge: the torque -c d(angle)/dt on a bar, or on both bars that it joins.

    The angle is coordinate i of the system, by default the first one; if j is given, it is the
    angle between the bars whose angles are i and j, with the opposite torque on j. Each hinge has a
    damper of its own: of a double pendulum ``HingeDamper(c)`` damps the first one and
    ``HingeDamper(c, i=1, j=0)`` the second one, and two effects on one hinge add up. It is for
    systems whose coordinates are angles, and acts on any coordinate as if it were one.

    Attributes:
      c: () damping of the hinge [N m s].
    Example:
      >>> from jaxdyn import effects, scenes
      >>> swing = scenes.double_pendulum(rates=(1.0, 3.0), damping=(0.2, 0.1))
      >>> swing.effects[1:] == (effects.HingeDamper(0.2), effects.HingeDamper(0.1, i=1, j=0))
      True
    """

    c: Array = eqx.field(converter=as_float)
    i: int = eqx.field(static=True, default=0, kw_only=True)
    j: int | None = eqx.field(static=True, default=None, kw_only=True)

    def generalized(self, t, q, v):
        del t, q
        ends = _of_angle("i", self.i, v.shape[0])
        if self.j is not None:
            ends = ends - _of_angle("j", self.j, v.shape[0])
            if not ends.any():
                raise _checks.fail("j", f"another angle than i = {self.i}", self.j, _ONE_ANGLE)
        return -self.c * jnp.sum(ends * v) * ends

    def check(self, points: Points) -> None:
        del points
        _checks.array("c", self.c, (), "The damping coefficient of a hinge is in N m s.")


# Number of links up to which a network is written as slices and sums, one for each link. A gather,
# whose reverse mode is a scatter, or a sum over all points would keep a stepping loop with tangents
# from being folded and vectorised (20 links then take 2.5 times as long, 63 twice). With tangents,
# each link takes 0.1 s to compile in this form, and a larger network is too large to be folded.
_UNROLLED_LINKS = 64


class SpringNetwork(Effect):
    """Linear springs along given pairs of points, as one effect.

    `links` are the pairs, e.g. ``((0, 1), (1, 2))``.

    Attributes:
      k: (e,) stiffnesses of the pairs, or () of all [N/m].
      length: (e,) rest lengths of the pairs, or () of all [m].
    """

    k: Array
    length: Array
    first: tuple[int, ...] = eqx.field(static=True)
    second: tuple[int, ...] = eqx.field(static=True)
    velocity_dependent: ClassVar[bool] = False

    def __init__(self, links: Sequence[tuple[int, int]], k, length=0.0):
        self.first = tuple(i for i, _ in links)
        self.second = tuple(j for _, j in links)
        self.k, self.length = floats(k, length)

    def _springs(self, r: Array) -> tuple[Array, Array, Array]:
        e = len(self.first)
        if e > _UNROLLED_LINKS:
            d = r[np.array(self.first)] - r[np.array(self.second)]
        else:
            d = jnp.stack([r[i] - r[j] for i, j in zip(self.first, self.second, strict=True)])
        return jnp.broadcast_to(self.k, (e,)), jnp.broadcast_to(self.length, (e,)), d

    def potential(self, t, r, m):
        del t, m
        return jnp.sum(_energy(*self._springs(r)))

    def force(self, t, r, v, m):
        del t, v, m
        pulls = _pulls(*self._springs(r))
        if len(self.first) > _UNROLLED_LINKS:
            return sums_at(jnp.concatenate([-pulls, pulls]), self.first + self.second, len(r))
        total = [jnp.zeros_like(r[0])] * r.shape[0]
        for i, j, pull in zip(self.first, self.second, pulls, strict=True):
            total[i], total[j] = total[i] - pull, total[j] + pull
        return jnp.stack(total)

    def sketch(self, t, r):
        del t
        ends = jnp.stack([r[np.asarray(ends, int)] for ends in (self.first, self.second)], axis=1)
        return (Shape("spring", ends),)

    def pieces(self, m):
        del m
        ends = tuple(zip(self.first, self.second, strict=True))
        each = (jnp.broadcast_to(x, (len(ends),)) for x in (self.k, self.length))
        return tuple(
            Spring(k, length, i=i, j=j) for (i, j), k, length in zip(ends, *each, strict=True)
        )

    def check(self, points: Points) -> None:
        for i, j in zip(self.first, self.second, strict=True):
            _check_ends(i, j, len(points.m))
        at_least_zero("length", self.length, "A rest length is in m.", len(self.first))
        each = (len(self.first),) if self.k.ndim else ()
        _checks.array("k", self.k, each, "A stiffness is in N/m.")


def _sketch(kind: Kind, r: Array, i: int, j: int | None, anchor: Array) -> tuple[Shape, ...]:
    """A spring or dashpot from a point to another one, or to an anchor with its pin."""
    far = end_of(r, j, anchor)
    link = Shape(kind, jnp.stack([r[i], far]))
    return (link,) if j is not None else (link, pin(far))


def _energy(k: Array, length: Array, d: Array) -> Array:
    # This is multiplied out, so that the second derivative is right for rest length 0 at r = 0.
    return 0.5 * k * (square_norm(d) - 2 * length * safe_norm(d) + length * length)


def _pulls(k: Array, length: Array, d: Array) -> Array:
    # There is one division for each spring, not one for each component of its direction.
    apart = safe_norm(d)
    return (k * (1.0 - length / jnp.where(apart == 0, 1.0, apart)))[..., None] * d


def _direction(d: Array) -> Array:
    """(..., d) unit vector along d, 0 where d is 0."""
    length = safe_norm(d)
    return d / jnp.where(length == 0, 1.0, length)[..., None]


def _of_angle(name: str, i: int, n: int) -> np.ndarray:
    """(n,) 1 for coordinate i, 0 for the others."""
    if not is_index(i, n):
        raise _checks.fail(name, f"a coordinate from 0 to {n - 1}", i, "Coordinates count from 0.")
    return np.eye(n)[i]


def _check_ends(i: int, j: int | None, n: int) -> None:
    point_number("i", i, n)
    if j is None:
        return
    point_number("j", j, n)
    if i % n == j % n:
        raise _checks.fail("j", f"another point than i = {i}", j, "Leave j out for an anchor.")
