"""What must hold for a motion to be a periodic orbit: how it closes, and further conditions.

The closing condition decides how long a motion is integrated and how many numbers are unknown.
Plain closing is y(T) = y(0). With a symmetry g of the scene, y(T / n) = g y(0) may be sufficient: a
choreography of three bodies needs a third of a period. A motion that starts on the fixed set of a
time reversal and meets such a set again retraces its path, which takes half of a period and half of
the unknowns. A motion that closes up to a rotation by an unknown angle is a relative periodic
orbit.
"""

import abc
import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene, System
from jaxdyn._checks import (
    array,
    as_float,
    check_first,
    check_on_host,
    choice,
    fail,
    positive,
    whole,
)
from jaxdyn._doors import renamed
from jaxdyn._records import Record
from jaxdyn.analysis import energy as energies
from orbits.closing.sizes import rates_at, sizes, times

# ---- Symmetries of a scene that permute the entries of its state and change their signs
#
# These include relabelling equal bodies, reflections, half turns and time reversals, but not
# rotations by other angles, for which see `orbits.relative`.

#: Largest error, in units of the sizes, by which a symmetry may fail to preserve the vector field.
EXACT = 1e-9
#: Distance from the start, in sizes, at which a symmetry is checked too: at rest, forces that
#: depend on the velocity do not show, such as drag or those of rotating axes.
_ASIDE = 0.01

A = TypeVar("A", Array, np.ndarray)


class Symmetry(Record):
    """The map y -> g y, where entry i of g y is ``signs[i]`` times entry ``places[i]`` of y.

    Attributes:
      places: (k,) index of the entry that each entry comes from; None for the identity.
      signs: (k,) +1 or -1 for each entry; None for all +1.
      reversing: whether it maps motions to time-reversed motions.
    """

    places: tuple[int, ...] | None = eqx.field(static=True, default=None)
    signs: tuple[int, ...] | None = eqx.field(static=True, default=None)
    reversing: bool = eqx.field(static=True, default=False)

    def act(self, y: A) -> A:
        """(k,) the symmetry applied to a state, or to a rate up to the direction of time."""
        y = y if self.places is None else y[np.array(self.places)]
        return y if self.signs is None else y * np.array(self.signs, float)

    @property
    def inverse(self) -> "Symmetry":
        """The symmetry that undoes this one."""
        signs = self.signs
        if self.places is None:
            return self
        back = np.argsort(self.places)
        signs = None if signs is None else tuple(np.array(signs)[back].tolist())
        return Symmetry(tuple(back.tolist()), signs, self.reversing)

    def check(self, scene: Scene, later: float = 0.0) -> None:
        """Raise ValueError unless this maps motions of the scene to motions of the scene.

        The images begin at time `later`, from which a reversing symmetry counts time backwards.
        """
        k = len(scene.y0)
        if self.places is not None and sorted(self.places) != list(range(k)):
            raise fail(
                "closing",
                f"a permutation of the {k} entries of the state",
                f"one of {len(self.places)} places",
                "choreography(n, d) makes one for n free points in d dimensions.",
            )
        if self.signs is not None and not (len(self.signs) == k and {*self.signs} <= {1, -1}):
            raise fail("closing", f"{k} signs, each 1 or -1", f"{self.signs}")
        self._check_rate(scene, later)

    def _check_rate(self, scene: Scene, later: float) -> None:
        # Otherwise the motion after the first part would not be an image of the first part.
        if self == IDENTITY and not later:
            return
        if not all(self._keeps_rate(scene, later, y) for y in _start_and_beside(scene)):
            raise fail(
                "closing",
                "a symmetry of the scene",
                "one that changes its forces",
                "Bodies that are exchanged need equal masses, forces that change with the sign of "
                "a velocity have no time reversal, and a drive must be the image of itself a part "
                "of the period earlier.",
            )

    def _keeps_rate(self, scene: Scene, later: float, y: np.ndarray) -> bool:
        """Whether the rate at the image of a state, if it has one, is the image of the rate."""
        ts, back = times(scene), -1.0 if self.reversing else 1.0
        there = np.asarray(rates_at(scene, later + back * ts, self.act(y)))
        here = back * np.stack([self.act(f) for f in np.asarray(rates_at(scene, ts, y))])
        most = EXACT * np.maximum(2 * np.pi / float(scene.t1) * sizes(scene), np.abs(here))
        return bool(((np.abs(there - here) <= most) | ~np.isfinite(here)).all())


def _start_and_beside(scene: Scene) -> np.ndarray:
    """(2, k) the start, and a state `_ASIDE` from it, at which symmetries are checked."""
    start = np.asarray(scene.y0)
    weights = np.random.default_rng(0).uniform(0.5, 1.0, start.shape)
    weights[1::2] *= -1.0
    aside = jnp.asarray(start + _ASIDE * sizes(scene) * weights)
    return np.stack([start, np.asarray(scene.system.project(jnp.zeros(()), aside))])


IDENTITY = Symmetry()


def order(act: Callable[[np.ndarray], np.ndarray], k: int) -> int:
    """The order of a symmetry on states of k entries: the power that is the identity."""
    entries = np.arange(1, k + 1)
    image, times = act(entries), 1
    while not np.array_equal(image, entries):
        image, times = act(image), times + 1
    return times


def point_symmetry(order, axes=(1, 1), *, reversing: bool = False) -> Symmetry:
    """A symmetry of free points: a relabelling, reflections of axes, optionally a time reversal.

    Args:
      order: (n,) index of the point whose place each point takes.
      axes: (d,) +1 or -1 for each axis of space.
      reversing: whether time is reversed, which changes the signs of the velocities once more.
    Example:
      >>> point_symmetry([1, 0, 2], (-1, -1), reversing=True).signs  # fixes Euler's starts
      (-1, -1, -1, -1, -1, -1, 1, 1, 1, 1, 1, 1)
    """
    order, axes = np.asarray(order), np.asarray(axes)
    n, d = len(order), len(axes)
    one = (order[:, None] * d + np.arange(d)).ravel()
    signs = np.tile(axes, n)
    return Symmetry(
        tuple(np.concatenate([one, n * d + one]).tolist()),
        tuple(np.concatenate([signs, -signs if reversing else signs]).tolist()),
        reversing,
    )


def time_reversal(k: int) -> Symmetry:
    """The time reversal of a state [q, v] of k entries, which changes the signs of v."""
    half = k // 2
    return Symmetry(None, (1,) * half + (-1,) * half, reversing=True)


# ---- Closing conditions: the state that a motion must reach after a part of its period

#: Angles tried for the first guess of the angle of a relative orbit: at least this many, and this
#: many for each turn of the fastest entries in 2 pi.
_ANGLES_TRIED, _ANGLES_A_TURN = 64, 16
#: Steps for each turn, and terms, of the series of a rotation; a rotation by 2 pi is then accurate
#: to rounding: 0.4^16 / 16! < 1e-19.
_ROTATION_STEPS, _ROTATION_TERMS = 16, 16


@renamed(miss="residual", rows="residual_units")
class Closing(Record):
    """What must hold after one part of the period for the motion to be periodic.

    Attributes:
      parts: number of such parts in a period.
      name: name in reports.
    """

    parts: eqx.AbstractVar[int]
    name: eqx.AbstractVar[str]

    @property
    def turns(self) -> bool:
        """Whether an angle is among the unknowns."""
        return False

    def free(self, k: int) -> np.ndarray:
        """(p,) indices of the entries of the start that are unknown; they determine the others."""
        return np.arange(k)

    def fixed(self, k: int) -> np.ndarray:
        """Indices of entries of the start that have the same value in every motion it allows."""
        del k
        return np.arange(0)

    def start(self, system: System, u: Array, base: Array) -> Float[Array, " k"]:
        """The start with unknowns u (p,); base (k,) is any start that the closing allows."""
        del base
        return system.project(jnp.zeros(()), jnp.asarray(u))

    @abc.abstractmethod
    def residual(self, system: System, end: Array, y0: Array, angle: Array) -> Array:
        """(m,) the closing error of a part of the motion that leads from `y0` to `end`."""

    def residual_units(self, each: np.ndarray) -> np.ndarray:
        """(m,) the sizes of the closing error's entries, from those (k,) of the state's entries."""
        return each

    def after(self, system: System, y0: Array, angle: float, periods: int) -> Array:
        """(k,) the state a number of whole periods after the start y0, or before it if negative."""
        del system, angle, periods
        return y0

    @property
    def mirror(self) -> Symmetry | None:
        """The time reversal by which each part retraces the one before; None if it does not.

        With one, two parts lead from a state to the one that `back` maps to it; otherwise one part
        does.
        """
        return None

    @abc.abstractmethod
    def back(self, system: System, y: Array, angle) -> Array:
        """(k,) the start whose image y the motion reaches after one part, or two with `mirror`."""

    def angle(self, system: System, end: Array, y0: Array) -> float:
        """Best guess of the angle [rad] for a part of the motion that leads from `y0` to `end`."""
        del system, end, y0
        return 0.0

    def fit_to(self, scene: Scene) -> "Closing":
        """The same condition with the numbers that it needs from a scene to which it applies."""
        del scene
        return self

    def check(self, scene: Scene) -> None:
        """Raise ValueError if the condition does not apply to the scene."""
        del scene
        if not (isinstance(self.parts, int) and self.parts >= 1):
            raise fail("closing", "at least one part of a period", self.parts)


class Return(Closing):
    """y(T / parts) = g y(0), up to a rotation by an unknown angle if `turn` names one.

    Attributes:
      symmetry: the symmetry g.
      parts: see `Closing`; the power of g that is the identity.
      name: see `Closing`.
      turn: name of the system's generator of the rotation, e.g. "turn in xy"; None without a
        rotation.
      frequency: how often the fastest entries of a state turn while the angle grows by 2 pi: once
        in space, k times for the k-th harmonic of a wave. `fit_to` finds it.
    """

    symmetry: Symmetry = IDENTITY
    parts: int = eqx.field(static=True, default=1)
    name: str = eqx.field(static=True, default="plain closing")
    turn: str | None = eqx.field(static=True, default=None)
    frequency: int = eqx.field(static=True, default=1)

    @property
    def turns(self):
        return self.turn is not None

    def act(self, system: System, y: Array, angle) -> Array:
        """(k,) g y, rotated by the angle [rad]."""
        y = self.symmetry.act(y)
        return y if self.turn is None else self._rotate(system, y, angle)

    def back(self, system, y, angle):
        y = y if self.turn is None else self._rotate(system, y, -angle)
        return self.symmetry.inverse.act(y)

    def _rotate(self, system: System, y: Array, angle) -> Array:
        """The flow of the generator g(y) = A y + b over an angle, by the series of exp(A angle).

        jax.scipy.linalg.expm would compute the same, but takes seconds to compile.
        """
        origin = system.generators(jnp.zeros_like(y))[self.turn]
        steps = _ROTATION_STEPS * self.frequency
        step = angle / steps

        def terms(n, term_and_sum):
            term, total = term_and_sum
            along = system.generators(term)[self.turn] - origin
            along = along + jnp.where(n == 1, origin, 0.0)
            term = along * step / n
            return term, total + term

        def once(_, y):
            return jax.lax.fori_loop(1, _ROTATION_TERMS, terms, (y, y))[1]

        return jax.lax.fori_loop(0, steps, once, y)

    def residual(self, system, end, y0, angle):
        return system.difference(end, self.act(system, y0, angle))

    def after(self, system, y0, angle, periods):
        if self.turn is None:  # the power of g is the identity
            return y0
        # The rotations need not add up: a reflection reverses the next one.
        once = self.act if periods > 0 else self.back
        for _ in range(self.parts * abs(periods)):
            y0 = once(system, y0, angle)
        return y0

    def angle(self, system, end, y0):
        if self.turn is None:
            return 0.0
        count = max(_ANGLES_TRIED, _ANGLES_A_TURN * self.frequency)
        tries = np.linspace(-np.pi, np.pi, count, endpoint=False)
        missed = jax.vmap(lambda angle: self.residual(system, end, y0, angle))(jnp.asarray(tries))
        return float(tries[np.argmin(np.linalg.norm(np.asarray(missed), axis=1))])

    def fit_to(self, scene):
        if self.turn is None:
            return self
        fastest = np.linalg.norm(_slope(scene, self.turn), 2)
        return dataclasses.replace(self, frequency=max(1, math.ceil(fastest * (1 - EXACT))))

    def check(self, scene):
        super().check(scene)
        self.symmetry.check(scene, float(scene.t1) / self.parts if self.parts > 1 else 0.0)
        if self.symmetry.reversing:
            raise fail("closing", "a symmetry that keeps the direction of time", "a reversing one")
        _check_parts(self.parts, order(self.symmetry.act, len(scene.y0)), "the order of g")
        if self.turn is not None:
            choice("turn", self.turn, scene.system.generators(scene.y0))
            _check_affine(scene, self.turn)
            _check_commutes(scene, self.turn)


class Reversal(Closing):
    """The motion starts on the fixed set of a time reversal and reaches that of another.

    From there it retraces its path, mirrored. If both reversals are the same, a part is half of a
    period. Otherwise their product is a symmetry g, and the number of parts in a period is twice
    the order of g.

    Attributes:
      here: the time reversal whose fixed set contains the start.
      there: the time reversal whose fixed set contains the state after a part.
      parts: see `Closing`.
      name: see `Closing`.
    """

    here: Symmetry
    there: Symmetry
    parts: int = eqx.field(static=True, default=2)
    name: str = eqx.field(static=True, default="reversal")

    def free(self, k):
        places, signs = _places_and_signs(self.here, k)
        index = np.arange(k)
        return index[(places > index) | ((places == index) & (signs > 0))]

    def fixed(self, k):
        places, signs = _places_and_signs(self.here, k)
        return np.flatnonzero((places == np.arange(k)) & (signs < 0))

    def start(self, system, u, base):
        y = base.at[self.free(len(base))].set(u)
        places, signs = _places_and_signs(self.here, len(base))
        # Of two entries that `here` exchanges, the later one follows from the earlier one.
        follows = np.flatnonzero(places < np.arange(len(base)))
        y = y.at[follows].set(signs[follows] * y[places[follows]])
        return system.project(jnp.zeros(()), y)

    def residual(self, system, end, y0, angle):
        del y0, angle
        return 0.5 * system.difference(end, self.there.act(end))[self._changes(len(end))]

    def residual_units(self, each):
        return each[self._changes(len(each))]

    @property
    def mirror(self):
        return self.there

    def back(self, system, y, angle):
        del system, angle
        return self.here.act(self.there.act(y))

    def _changes(self, k: int) -> np.ndarray:
        """Entries of a state that `there` changes, with only one of any two that it exchanges."""
        places, signs = _places_and_signs(self.there, k)
        index = np.arange(k)
        return np.flatnonzero((places > index) | ((places == index) & (signs < 0)))

    def check(self, scene):
        super().check(scene)
        # The reversal whose fixed set a motion meets at time t maps time 0 to 2 t.
        for symmetry, at in ((self.here, 0.0), (self.there, float(scene.t1) / self.parts)):
            symmetry.check(scene, 2 * at)
            places, signs = _places_and_signs(symmetry, len(scene.y0))
            twice = np.array_equal(places[places], np.arange(len(places)))
            if not (symmetry.reversing and twice and (signs == signs[places]).all()):
                raise fail("closing", "time reversals of order 2", "another symmetry")
        twice = 2 * order(lambda y: self.there.act(self.here.act(y)), len(scene.y0))
        _check_parts(self.parts, twice, "twice the order of both reversals' product")
        off = scene.system.difference(self.here.act(scene.y0), scene.y0)
        if not (np.abs(off) <= EXACT * sizes(scene)).all():
            raise fail(
                "y0",
                f"a start in the fixed set of the time reversal of {self.name!r}",
                f"one that it changes by {float(jnp.abs(off).max()):.3g}",
                "Give the nearest one in the set: (y0 + closing.here.act(y0)) / 2.",
            )


#: The plain closing: the state after a period is the start.
PLAIN = Return()


def choreography(n: int = 3, d: int = 2) -> tuple[Return, Return]:
    """The closings of n bodies on one curve: after T / n each is where the next one was.

    The bodies may follow each other in two orders; `find` takes the one with the smaller residual
    at its guess.

    Args:
      n: number of free points, at least 1.
      d: dimension of space.
    Raises:
      ValueError: not at least one body, or one dimension.
    """
    n, d = whole("n", n, remedy="It is the number of bodies."), whole("d", d)
    bodies = np.arange(n)
    there, back = (point_symmetry((bodies + step) % n, (1,) * d) for step in (1, -1))
    name = f"choreography of {n}"
    return (
        Return(symmetry=there, parts=n, name=name),
        Return(symmetry=back, parts=n, name=name),
    )


def relative(turn: str = "turn in xy", symmetry: Symmetry = IDENTITY, parts: int = 1) -> Return:
    """The closing of relative orbits, which are periodic in a rotating frame.

    After a part of the period the state is the symmetric image of the start, rotated by an unknown
    angle.

    Args:
      turn: name of the generator of the rotation in ``system.generators``.
      symmetry: the symmetry.
      parts: number of such parts in a period, at least 1.
    """
    return Return(symmetry=symmetry, parts=parts, name="relative closing", turn=turn)


def reversal(here: Symmetry, there: Symmetry | None = None, parts: int | None = None) -> Reversal:
    """The closing of motions that meet the fixed sets of time reversals, and retrace their path.

    Args:
      here: the time reversal whose fixed set contains the start.
      there: the time reversal whose fixed set contains the state after a part of the period; by
        default `here`.
      parts: number of such parts in a period; by default 2, for equal reversals.
    Raises:
      ValueError: `here` and `there` differ and `parts` is not given.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> at_rest = orbits.reversal(orbits.time_reversal(2))
      >>> swing = orbits.find(scenes.pendulum(angle=2.0), period=9.0, closing=at_rest)
      >>> swing.closing.parts
      2
    """
    there = here if there is None else there
    if parts is None and there != here:
        raise fail("parts", "a number where two reversals differ", "none", "2 x the order of both.")
    return Reversal(here=here, there=there, parts=2 if parts is None else parts)


@check_first
def mirror(scene: Scene, across: str | None = None) -> Reversal:
    """The closing of motions that cross a plane or an axis at right angles and are mirrored there.

    Most known orbits in rotating axes, as in the restricted three-body problem, do so: halo and
    Lyapunov orbits cross the plane xz, planar orbits the x axis.

    Args:
      scene: points in rotating axes, or others that have this symmetry; the start must lie in the
        plane or on the axis, with its velocity at right angles to it.
      across: the axes that span the plane or line, among "x", "y" and "z"; by default "xz" in
        space, and "x" in a plane.
    Raises:
      ValueError: the scene has no points, or no such axes.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> scene = scenes.restricted_three_body_in_space()
      >>> halo = orbits.find(scene, closing=orbits.closing.mirror(scene), hold="z")
      >>> halo.ok, [float(x) for x in halo.y0[1::2]]
      (True, [0.0, 0.0, 0.0])
    """
    n, d = scene.points(jnp.zeros(()), scene.y0).r.shape
    axes = "xyz"[:d]
    across = axes.replace("y", "") if across is None else across
    if not (isinstance(across, str) and 0 < len(set(across)) < d and set(across) <= set(axes)):
        raise fail("across", f"fewer than all of the axes {', '.join(axes)}", repr(across))
    signs = [1 if axis in across else -1 for axis in axes]
    return reversal(point_symmetry(range(n), signs, reversing=True))


@check_first
def symmetric_closing(scene: Scene) -> str:
    """How to write a closing by reversal that suits the start of a scene; "" if there is none.

    It is a mirror that the start crosses at a right angle, for example, or the time reversal for a
    motion that starts at rest and swings back.

    Raises:
      ValueError: the numbers of the scene are traced by `jax.jit` or `jax.grad`.
    """
    check_on_host("scene", scene)
    d = scene.points(jnp.zeros(()), scene.y0).r.shape[1] if scene.has_points else 0
    axes = [name for n in range(d - 1, 0, -1) for name in itertools.combinations("xyz"[:d], n)]
    for across in map("".join, axes):
        if _applies(mirror(scene, across), scene):
            return f'closing=orbits.closing.mirror(scene, "{across}")'
    k = len(scene.y0)
    if k % 2 == 0 and _applies(reversal(time_reversal(k)), scene):
        return f"closing=orbits.reversal(orbits.time_reversal({k}))"
    return ""


def _applies(closing: Closing, scene: Scene) -> bool:
    try:
        closing.check(scene)
    except ValueError:
        return False
    return True


def _places_and_signs(symmetry: Symmetry, k: int) -> tuple[np.ndarray, np.ndarray]:
    places = np.arange(k) if symmetry.places is None else np.array(symmetry.places)
    return places, np.ones(k) if symmetry.signs is None else np.array(symmetry.signs, float)


def _check_parts(parts: int, least: int, what: str) -> None:
    if parts % least:
        remedy = "After a whole period each point is where it was."
        raise fail("parts", f"a multiple of {what}, {least}", parts, remedy)


@functools.partial(jax.jit, static_argnames="turn")
def _slope(scene: Scene, turn: str) -> Array:
    """(k, k) the derivative of a generator with respect to the state, at the start."""
    return jax.jacfwd(lambda y: scene.system.generators(y)[turn])(scene.y0)


def _check_affine(scene: Scene, turn: str) -> None:
    def generator(y):
        return scene.system.generators(y)[turn]

    y, zero = scene.y0, jnp.zeros_like(scene.y0)
    extrapolated = 2 * generator(y) - generator(zero)
    if not (np.abs(generator(2 * y) - extrapolated) <= EXACT * sizes(scene)).all():
        raise fail("turn", "a generator linear in the state", f"{turn!r}", "Use other coordinates.")


def _check_commutes(scene: Scene, turn: str) -> None:
    # Otherwise the motion after the first part would not be the rotated first part.
    entry_sizes, radian = sizes(scene), float(scene.t1) / (2 * np.pi)
    ys, ts = jnp.asarray(_start_and_beside(scene)), jnp.asarray(times(scene))
    both = _commutator(scene, ys, ts, turn=turn)
    turned, moved = (radian * np.asarray(x) / entry_sizes for x in both)
    size = 1.0 + np.linalg.norm(turned, axis=-1) + np.linalg.norm(moved, axis=-1)
    keeps = np.linalg.norm(turned - moved, axis=-1) <= EXACT * size
    if not (keeps | ~np.isfinite(turned).all(axis=-1)).all():
        raise fail(
            "turn", "a symmetry of the scene", f"{turn!r}, which changes its forces", "Use PLAIN."
        )


@functools.partial(jax.jit, static_argnames="turn")
def _commutator(scene: Scene, ys: Array, ts: Array, *, turn: str) -> tuple[Array, Array]:
    """The change of a generator along the rate, and that of the rate along the generator.

    Both are (n, s, k), at n states `ys` (n, k) and s times `ts` (s,): at rest drag does not show,
    and a drive may vanish at the first time.
    """

    def generator(y):
        return scene.system.generators(y)[turn]

    def at(y, t):
        def rate(y):
            return scene.rate(t, y)

        f, g = rate(y), generator(y)
        return tuple(jax.jvp(a, (y,), (b,))[1] for a, b in ((generator, f), (rate, g)))

    return jax.vmap(jax.vmap(at, (None, 0)), (0, None))(ys, ts)


# ---- Conditions on an orbit besides closing: a given energy, period, entry of the start
#
# Periodic orbits of conservative scenes form families; a condition selects one member.
# Without one, `find` returns the member through the given start, if that is periodic, and otherwise
# a member near it.


class Condition(Record):
    """One smooth equation on an orbit."""

    @abc.abstractmethod
    def value(self, scene: Scene, y0: Float[Array, " k"], period: Array) -> Array:
        """() the error of the condition, zero where it holds."""

    def fix(
        self, guess: np.ndarray, lower: np.ndarray, upper: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Bounds (k + 1,) of start and period that enforce the condition if the guess satisfies it.

        An entry held by its bounds does not change at all, not even by rounding.
        """
        del guess
        return lower, upper

    def check(self, scene: Scene) -> None:
        """Raise ValueError if the condition does not apply to the scene."""
        del scene


def _fix_entry(entry: int, level, guess: np.ndarray, lower: np.ndarray, upper: np.ndarray):
    """Bounds that hold one entry of start and period, if the guess has the level."""
    if guess[entry] == float(level):
        here = np.arange(len(guess)) == entry % len(guess)
        lower, upper = (np.where(here, guess, bound) for bound in (lower, upper))
    return lower, upper


class Energy(Condition):
    """The condition that the energy has a given value [J]."""

    level: Array = eqx.field(converter=as_float)

    def value(self, scene, y0, period):
        del period
        return energies.energy(scene, jnp.zeros(()), y0) - self.level

    def check(self, scene):
        array("energy", self.level, (), "It is the energy of the orbit.")
        energies.energy(scene, jnp.zeros(()), scene.y0)  # raises for a scene without one


class Period(Condition):
    """The condition that the full period has a given value [time of the scene]."""

    length: Array = eqx.field(converter=as_float)

    def value(self, scene, y0, period):
        del scene, y0
        return period - self.length

    def fix(self, guess, lower, upper):
        return _fix_entry(-1, self.length, guess, lower, upper)

    def check(self, scene):
        positive("period", array("period", self.length, (), "It is a time."), "It is a time.")


class Section(Condition):
    """The phase condition that the orbit starts where an entry of the state has a given value.

    All members of a family may pass there, with different values of the other entries; to select
    one member, hold these too, or the energy.
    """

    entry: int = eqx.field(static=True)
    level: Array = eqx.field(converter=as_float, default=0.0)

    def value(self, scene, y0, period):
        del scene, period
        return y0[self.entry] - self.level

    def fix(self, guess, lower, upper):
        return _fix_entry(self.entry, self.level, guess, lower, upper)

    def check(self, scene):
        k = len(scene.y0)
        if not (isinstance(self.entry, int) and 0 <= self.entry < k):
            raise fail("entry", f"an entry of the state, 0 to {k - 1}", repr(self.entry))
        array("level", self.level, (), "It is the value of the entry.")


#: What `find` and others accept as `hold`: conditions, or names of entries of the start.
Hold = Condition | str | Sequence[Condition | str]


def conditions(scene: Scene, hold: Hold, closings: Iterable[Closing]) -> tuple[Condition, ...]:
    """The conditions in `hold`; the name of an entry stands for its value at the scene's start.

    Raises:
      ValueError: an element is neither a `Condition` nor the name of an entry of the state, or
        does not apply to the scene, or is one on an entry that a closing fixes.
    """
    names = [label for label, _ in scene.system.labels()]
    fixed = {int(i): closing.name for closing in closings for i in closing.fixed(len(names))}
    given = tuple(hold) if isinstance(hold, list | tuple) else (hold,)
    found = []
    for one in given:
        if isinstance(one, str):
            entry = names.index(choice("hold", one, names))
            one = Section(entry, scene.y0[entry])
        if not isinstance(one, Condition):
            remedy = f"orbits.Energy(-1.0) is one, and so is the name of an entry: {names}."
            raise fail("hold", "a Condition", repr(one), remedy)
        one.check_functions()
        one.check(scene)
        if isinstance(one, Section) and one.entry in fixed:
            free = [name for i, name in enumerate(names) if i not in fixed]
            wanted = f"an entry that {fixed[one.entry]!r} leaves free: {', '.join(free)}"
            raise fail("hold", wanted, repr(names[one.entry]), "All such starts have that value.")
        found.append(one)
    return tuple(found)
