"""Bars in the plane, hinged in a row: in their angles, or as bodies or points with ties.

Angles are measured counterclockwise from hanging straight down; x points right, y up, and the first
hinge is the origin. The bars are uniform, or massless with point masses at their ends. A uniform
bar is equivalent to three points: a sixth of its mass at each end and the rest at its middle
(Simpson's rule, exact for the moment of inertia). The points are therefore the hinges and the
middles, and a drawing that joins the hinges shows the bars.

This file has the geometry and the masses; the equations of motion follow from them in
`formulations`.
"""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _doors
from jaxdyn._numerics import safe_norm
from jaxdyn.formulations.mechanism import Mechanism, stretch
from jaxdyn.joints import Joint, Part, along, particles, pinned, rod
from jaxdyn.sketch import Shape, frame, line, pin, rectangle, traces

_END, _MIDDLE = 1 / 6, 4 / 6  # shares of a uniform bar's mass
#: Relative slack below which bars count as stretched out.
_MIN_SLACK = 1e-12


class Chain(Mechanism):
    """Bars hinged in a row, described by one angle each.

    Attributes:
      m: (n,) masses [kg].
      l: (n,) lengths [m].
      end: (2,) where the far end is pinned [m]; None where it is free.
      relative: whether each angle but the first is measured from the previous bar.
      skate: whether the far end slides only along the last bar, as on a skate.
      uniform: whether the bars are uniform; otherwise the mass of each is a point at its far end.
    """

    m: Array
    l: Array  # noqa: E741 the course's name
    end: Array | None = None
    relative: bool = eqx.field(static=True, default=False)
    skate: bool = eqx.field(static=True, default=False)
    uniform: bool = eqx.field(static=True, default=True)

    def coordinates(self):
        name = "phi" if self.relative else "theta"
        return tuple((f"{name}{i + 1}", "rad") for i in range(self.m.shape[0]))

    def masses(self):
        return row_masses(self.m) if self.uniform else self.m

    def positions(self, t, q):
        del t
        return self._points(q) if self.uniform else self.hinge_points(q)[1:]

    def _points(self, q: Array) -> Array:
        """(2 n + 1, 2) the hinges, then the middles."""
        angle = self.angles(q)
        return row_points(self.l[:, None] * jnp.stack([jnp.sin(angle), -jnp.cos(angle)], axis=1))

    def hinge_points(self, q: Array) -> Array:
        """(n + 1, 2) the hinges, from the origin to the far end."""
        return self._points(q)[: len(q) + 1]

    def point_masses(self, t: Array, q: Array) -> Array:
        """(2 n,) the coordinates of these point masses as `PointMasses`."""
        del t
        return self.hinge_points(q)[1:].ravel()

    def free_bars(self, t: Array, q: Array) -> Array:
        """(3 n,) the coordinates of these bars as `FreeBars`."""
        del t
        middles = self._points(q)[len(q) + 1 :]
        return jnp.concatenate([middles, self.angles(q)[:, None]], axis=1).ravel()

    def angles(self, q: Array) -> Array:
        """(n,) the angles of the bars from hanging straight down."""
        return _combine(np.tri(len(q)), q[:, None])[:, 0] if self.relative else q

    def constraints(self, t, q):
        del t
        return None if self.end is None else self.hinge_points(q)[-1] - self.end

    def rolling(self, t, q):
        del t
        if not self.skate:
            return None
        angle = self.angles(q)[-1]
        across = jnp.stack([jnp.cos(angle), jnp.sin(angle)])
        velocities = jax.jacfwd(lambda q: self.hinge_points(q)[-1])(q)
        return jnp.sum(across[:, None] * velocities, axis=0)[None, :]

    def bodies(self, t, q):
        del t
        joints = self.hinge_points(q)
        return bar_parts(self.m, joints) if self.uniform else point_mass_parts(self.m)

    def joints(self, t, q):
        del t
        joints = self.hinge_points(q)
        if not self.uniform:
            return massless_rods(joints)
        last = len(q) - 1
        if self.skate:
            across = frame(joints[-1] - joints[-2])[:, 1]
            skate = along("skate", last, None, joints[-1], across, 0)
            return skate, *hinges(joints[:-1])
        if self.end is None:
            return hinges(joints[:-1])
        far = pinned(f"hinge {last + 2}", last, None, joints[-1], 0)
        return far, *hinges(joints[:-1])

    def sketch(self, t, q):
        del t
        return bar_shapes(self.hinge_points(q), self.end, skate=self.skate)

    def check(self):
        check_bars(self.m, self.l, self.end)


class FreeBars(Mechanism):
    """The same bars as free bodies, described by x, y of each middle and theta, tied by hinges.

    The multipliers of the ties are the forces in the hinges [N], x and y for each hinge in turn.

    Attributes:
      m: (n,) masses [kg].
      l: (n,) lengths [m].
      end: (2,) where the far end is pinned [m]; None where it is free.
    """

    m: Array
    l: Array  # noqa: E741 the course's name
    end: Array | None = None

    def coordinates(self):
        units = (("x", "m"), ("y", "m"), ("theta", "rad"))
        return tuple((f"{a}{i + 1}", unit) for i in range(self.m.shape[0]) for a, unit in units)

    def masses(self):
        return jnp.concatenate([_END * self.m, _END * self.m, _MIDDLE * self.m])

    def positions(self, t, q):
        del t
        near, middle, far = self._bars(q)
        return jnp.concatenate([near, far, middle])

    def constraints(self, t, q):
        del t
        near, _, far = self._bars(q)
        hinges = near - jnp.concatenate([jnp.zeros((1, 2)), far[:-1]])
        if self.end is not None:
            hinges = jnp.concatenate([hinges, (far[-1] - self.end)[None, :]])
        return hinges.ravel()

    def bodies(self, t, q):
        del t
        near, _, far = self._bars(q)
        n = self.m.shape[0]
        ends = [near, far]
        return tuple(
            Part(
                f"bar {i + 1}",
                (i, n + i, 2 * n + i),
                self.m[i] * jnp.array([_END, _END, _MIDDLE]),
                True,
                (line(*(end[i] for end in ends)),),
            )
            for i in range(n)
        )

    def joints(self, t, q):
        del t
        near, _, far = self._bars(q)
        n = self.m.shape[0]
        found = hinges(near, multipliers=True)
        if self.end is None:
            return found
        # The last tie is the position of the far end; its multiplier is the force on that end.
        return *found, pinned(f"hinge {n + 1}", n - 1, None, far[-1], 2 * n)

    def sketch(self, t, q):
        del t
        near, _, far = self._bars(q)
        return bar_shapes(jnp.concatenate([near[:1], far]), self.end)

    def check(self):
        check_bars(self.m, self.l, self.end)

    def _bars(self, q: Array) -> tuple[Array, Array, Array]:
        """The near ends, middles and far ends of the bars, (n, 2) each."""
        x, y, angle = q.reshape(-1, 3).T
        middle = jnp.stack([x, y], axis=1)
        half = 0.5 * self.l[:, None] * jnp.stack([jnp.sin(angle), -jnp.cos(angle)], axis=1)
        return middle - half, middle, middle + half


class PointMasses(Mechanism):
    """Point masses in a row on massless rods from the origin, described by x and y; rods are ties.

    The multipliers are the forces along the rods [N], positive where a rod pushes.

    Attributes:
      m: (n,) masses [kg].
      l: (n,) lengths of the rods [m].
    """

    m: Array
    l: Array  # noqa: E741 the course's name

    def coordinates(self):
        return tuple((f"{a}{i + 1}", "m") for i in range(self.m.shape[0]) for a in "xy")

    def masses(self):
        return self.m

    def positions(self, t, q):
        del t
        return q.reshape(-1, 2)

    def constraints(self, t, q):
        rods = jnp.diff(self.positions(t, q), axis=0, prepend=jnp.zeros((1, 2)))
        return stretch(jnp.sum(rods * rods, axis=1), self.l, squared=False)

    def rods(self):
        return tuple(f"rod {i + 1}" for i in range(self.m.shape[0]))

    def bodies(self, t, q):
        del t, q
        return point_mass_parts(self.m)

    def joints(self, t, q):
        joints = jnp.concatenate([jnp.zeros((1, 2)), self.positions(t, q)])
        return massless_rods(joints, multipliers=True)

    def sketch(self, t, q):
        return bar_shapes(jnp.concatenate([jnp.zeros((1, 2)), self.positions(t, q)]), None)

    def check(self):
        check_bars(self.m, self.l, None)


def row_points(bars: Array) -> Array:
    """(2 n + 1, 2) the hinges, then the middles, of bars given as vectors (n, 2) in a row."""
    n = bars.shape[0]
    before = np.tri(n + 1, n, -1)
    # Constant weights rather than a running sum: few operations on whole arrays compile to
    # code twice as fast as that of many scalar ones.
    return _combine(np.concatenate([before, before[:n] + 0.5 * np.eye(n)]), bars)


def row_masses(m: Array) -> Array:
    """(2 n + 1,) the masses of the points of `row_points`, for bars of masses m (n,)."""
    none = jnp.zeros(1)
    ends = _END * (jnp.concatenate([none, m]) + jnp.concatenate([m, none]))
    return jnp.concatenate([ends, _MIDDLE * m])


def bar_parts(m: Array, joints: Array) -> tuple[Part, ...]:
    """The bars of masses m (n,) through joints (n + 1, 2), as parts with points of `row_points`."""
    n = m.shape[0]
    shares = jnp.array([_END, _END, _MIDDLE])
    return tuple(
        Part(
            f"bar {i + 1}",
            (i, i + 1, n + 1 + i),
            m[i] * shares,
            True,
            (line(joints[i], joints[i + 1]),),
        )
        for i in range(n)
    )


def point_mass_parts(m: Array) -> tuple[Part, ...]:
    """The point masses (n,) at the ends of massless rods, each a body of its own."""
    return particles(m, tuple(f"mass {i + 1}" for i in range(m.shape[0])))


def hinges(near: Array, *, multipliers: bool = False) -> tuple[Joint, ...]:
    """The hinges at the near ends (n, 2) of bars, at which the previous bar holds each of them."""
    return tuple(
        pinned(f"hinge {i + 1}", i, i - 1 if i else None, place, 2 * i if multipliers else None)
        for i, place in enumerate(near)
    )


def massless_rods(joints: Array, *, multipliers: bool = False) -> tuple[Joint, ...]:
    """The massless rods through joints (n + 1, 2), the first of which is fixed."""
    return tuple(
        rod(f"rod {i + 1}", i, i - 1 if i else None, ends, i if multipliers else None)
        for i, ends in enumerate(itertools.pairwise(joints))
    )


def bar_shapes(joints: Array, end: Array | None, *, skate: bool = False) -> tuple[Shape, ...]:
    """Shapes of bars through joints (n + 1, 2), pinned at the first and, with `end`, the last."""
    inner = [f"hinge {i}" for i in range(1, len(joints) - 1)]
    bars, first = line(*joints), pin(joints[0])
    if end is not None:
        return bars, first, pin(joints[-1]), *traces(joints[1:-1], inner)
    free = traces(joints[1:], [*inner, "tip"])
    if not skate:
        return bars, first, *free
    along = joints[-1] - joints[-2]
    blade = rectangle("solid", (0.3 * safe_norm(along), 0.05 * safe_norm(along)))
    return bars, first, blade.place(joints[-1], frame(along)), *free


def check_bars(m: Array, l: Array, end: Array | None, span: str = "end") -> None:  # noqa: E741
    """Raise ValueError unless the lengths are positive, one for each mass, and reach the far end.

    Bars that only just reach it are refused as well, since they cannot move when stretched out.

    Args:
      m: (n,) masses [kg].
      l: (n,) lengths [m].
      end: (2,) where the far end is pinned [m]; None where it is free.
      span: name of the distance of the far end in messages.
    """
    _checks.array("length", l, m.shape, "One length for each mass.")
    _checks.positive("length", l, "Lengths are in m.")
    if end is None or _checks.is_traced((l, end)):
        return
    sides = np.append(np.asarray(l), np.hypot(*np.asarray(end)))
    longest = sides.max()
    _checks.finite(span, end, "It is the distance of the far hinge, in m.")
    if longest >= (sides.sum() - longest) * (1 - _MIN_SLACK):
        raise _checks.fail(
            span if longest == sides[-1] else "length",
            "links that can close",
            f"a longest side of {longest:.6g} m and {sides.sum() - longest:.6g} m in all others",
            "Shorten the longest link or move the far hinge.",
        )


def _combine(weights: np.ndarray, x: Array) -> Array:
    # A product as a sum, for the reason given at mechanism.weighted_gram.
    return jnp.sum(weights[:, :, None] * x[None, :, :], axis=1)


#: Renamed in version 0.3.
_RENAMED = {"Bodies": "FreeBars", "Bobs": "PointMasses"}
__getattr__ = _doors.attribute_getter(__name__, renamed=_RENAMED)
