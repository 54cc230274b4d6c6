"""What is true of a kind of scene, found once: its conditions, and how its rate depends on time.

A `Plan` is read from the program of a rate (`branches`), not from values at a few points. It is the
same for all scenes of a kind, whatever their numbers, and is kept with the kind.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxdyn.plan.bounds import Bounds, as_bounds, enclose_program
from jaxdyn.plan.branches import (
    BY_STATE,
    BY_TIME,
    OF_TIME,
    Condition,
    Value,
    Walk,
)
from jaxdyn.plan.period import period_of


class Conditions(NamedTuple):
    """The conditions of a rate at a point of a motion.

    Attributes:
      outcomes: (e,) the outcomes that hold there, each in the branch of those before it.
      margins: (e,) how far each is from changing in the branch; negative where it has changed.
      beyond: (e,) the outcomes on the other side of the nearest change.
    """

    outcomes: Array
    margins: Array
    beyond: Array


_KINDS = 256  # number of kinds of rates whose plans are kept


class Plan:
    """The plan of a kind of rate.

    Attributes:
      depends_on_time: whether the rate depends on time; if not, that is proved.
      conditions: the conditions, in the order in which the program meets them.
      of_time: (e,) for each entry of a branch, whether it depends on time alone.
      unread: names of operations that may hide conditions.
      bounded: whether all operations on time alone have bounds.
      partial: whether the rate contains functions that are not defined for all states.
      mixed: whether it contains functions of time and state that may act just as briefly.
      hides: whether parts of the rate that depend on time alone may act so briefly that a step
        would pass over them.
    """

    def __init__(self, program: Any, tree: Any, leaves: list, y: Any, waves: bool = False):
        self._program, self._tree, self._leaves, self._state = program, tree, leaves, y
        self._time = jax.ShapeDtypeStruct((), y.dtype)
        self._waves = waves
        found: list[Walk] = []
        results: list[int] = []

        def walk(leaves, t, y):
            whole = Walk(None)
            (rate,) = whole.program(program, _inputs(leaves, t, y))
            results.append(rate.on)
            part = Walk(None, time_only=True, waves=waves)
            deep = Walk(None, every_call=True)
            if rate.on & OF_TIME:  # most rates do not depend on time, and need no more walks
                part.results(part.program(program, _inputs(leaves, t, y)))
                deep.program(program, _inputs(leaves, t, y))
            found.extend([whole, part, deep])
            return rate.array

        jax.eval_shape(walk, leaves, self._time, y)
        whole, part, deep = found
        self.depends_on_time = bool(results[0] & OF_TIME)
        self.conditions: tuple[Condition, ...] = tuple(whole.conditions)
        sides = [np.full(c.size, c.of_time) for c in self.conditions]
        self.of_time = np.concatenate([np.zeros(0, bool), *sides])
        self.unread = frozenset(whole.unread)
        self.hides = bool(part.leaves)
        self.bounded = True
        if self.hides or self.of_time.any():
            unknown = self._without_bounds()
            self.unread |= {f"{name} of time" for name in unknown}
            self.bounded = not unknown
            self.hides &= self.bounded
        self.partial = whole.partial
        self.mixed = bool(deep.mixed) and not self._mixed_without_bounds()

    @property
    def size(self) -> int:
        """Number of entries of a branch."""
        return len(self.of_time)

    @property
    def _branch(self) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct((self.size,), self._state.dtype)

    @property
    def on_state(self) -> bool:
        """Whether any condition depends on the state."""
        return bool((~self.of_time).any())

    @property
    def doubt(self) -> str:
        """What a step may pass over unseen, and the remedy; empty if everything can be read."""
        if not self.unread:
            return ""
        return (
            f"The rate contains what cannot be read ({', '.join(sorted(self.unread))}): a pulse or "
            "a switch in it may have been passed over. Pass max_step=, a time that resolves it, or "
            "breaks=, the times at which it changes."
        )

    def period(self, system: PyTree) -> float | None:
        """The period of the rate in time; None where it has none that can be read."""
        return period_of(self._program, system)

    def look(self, system: PyTree, t: Array, y: Array, branch: Array | None = None):
        """The rate (k,) of a system of this kind in a branch (e,), and its `Conditions` there.

        Without a branch, it takes the branch of the outcomes at the point.
        """
        walk = Walk(branch)
        leaves = jax.tree.leaves(system)
        (rate,) = walk.program(self._program, _inputs(leaves, t, y))
        return rate.array, _conditions(walk)

    def time_parts(self, system: PyTree, t: Array, branch: Array | None) -> Array:
        """(u,) the parts of the rate that depend on time alone, in a branch (e,)."""
        return jnp.concatenate([jnp.zeros(0), *map(jnp.ravel, self._in_time(system, t, branch)[0])])

    def time_conditions(self, system: PyTree, t: Array, branch: Array | None) -> Conditions:
        """The conditions that depend on time alone, in a branch (e,)."""
        return self._in_time(system, t, branch)[1]

    def _in_time(self, system: PyTree, t: Array, branch: Array | None):
        given = None if branch is None else branch[np.flatnonzero(self.of_time)]
        walk = Walk(given, time_only=True, waves=self._waves)
        leaves = jax.tree.leaves(system)
        walk.results(walk.program(self._program, _inputs(leaves, t, None)))
        return [jnp.asarray(x.array, float) for x in walk.leaves], _conditions(walk)

    def bounds_of_parts(
        self, system: PyTree, low: Array, high: Array, branch: Array
    ) -> tuple[Bounds, Array]:
        """(u,) bounds of `time_parts` from one time to another, and of the size of their slopes.

        The bounds are the narrower of those of the formulas and those by slopes about the middle.
        """
        given = [*jax.tree.leaves(system), branch]
        parts, slopes, _ = self._programs
        (plain,) = enclose_program(parts, [*given, Bounds(low, high)])
        (slope,) = enclose_program(slopes, [*given, Bounds(low, high)])
        plain, slope = as_bounds(plain), as_bounds(slope)
        middle = as_bounds(enclose_program(parts, [*given, 0.5 * (low + high)])[0]).low
        steepest = jnp.maximum(jnp.abs(slope.low), jnp.abs(slope.high))
        steepest = jnp.where(jnp.isnan(steepest), jnp.inf, steepest)
        most = 0.5 * (high - low) * steepest
        most = jnp.where(jnp.isnan(most), jnp.inf, most)
        low, high = jnp.maximum(plain.low, middle - most), jnp.minimum(plain.high, middle + most)
        return Bounds(low, high), steepest

    def mixed_parts(self, system: PyTree, t: Array, y: Array, branch: Array) -> Array:
        """(2, m) the arguments and values of functions of time and state that may act briefly."""
        walk = Walk(branch, every_call=True)
        walk.program(self._program, _inputs(jax.tree.leaves(system), t, y))
        rows = (walk.mixed[i::2] for i in (0, 1))
        return jnp.stack([jnp.concatenate([jnp.ravel(x.array) for x in row]) for row in rows])

    def bounds_of_mixed(self, system: PyTree, t: Bounds, y: Bounds, branch: Array) -> Bounds:
        """(2, m) bounds of `mixed_parts` over times () and states (k,)."""
        (found,) = enclose_program(self._mixed_program, [*jax.tree.leaves(system), branch, t, y])
        return as_bounds(found)

    @functools.cached_property
    def _mixed_program(self):
        def mixed(*given):
            *leaves, branch, t, y = given
            return self.mixed_parts(jax.tree.unflatten(self._tree, leaves), t, y, branch)

        with jax.ensure_compile_time_eval():
            return jax.make_jaxpr(mixed)(*self._leaves, self._branch, self._time, self._state)

    def _mixed_without_bounds(self) -> set[str]:
        unknown: set[str] = set()

        def enclose(*given):
            *known, low, high, t = given
            enclose_program(self._mixed_program, [*known, Bounds(t, t), Bounds(low, high)], unknown)
            return t

        jax.eval_shape(enclose, *self._leaves, self._branch, self._state, self._state, self._time)
        return unknown

    def bounds_of_rate(self, system: PyTree, low: Array, high: Array, y: Array) -> Bounds:
        """(k,) bounds of the rate at a state from one time to another."""
        given = [*jax.tree.leaves(system), Bounds(low, high), y]
        return as_bounds(enclose_program(self._program, given)[0])

    def _without_bounds(self) -> frozenset[str]:
        """Names of operations on time alone that have no bounds."""
        unknown: set[str] = set()

        def enclose(*given):
            *known, low, high = given
            for program in self._programs:
                enclose_program(program, [*known, Bounds(low, high)], unknown)
            return low

        jax.eval_shape(enclose, *self._leaves, self._branch, self._time, self._time)
        return frozenset(unknown)

    def bounds_of_margins(self, system: PyTree, low: Array, high: Array, branch: Array) -> Bounds:
        """Bounds of the margins of `time_conditions` from one time to another."""
        given = [*jax.tree.leaves(system), branch]
        (found,) = enclose_program(self._programs[2], [*given, Bounds(low, high)])
        return as_bounds(found)

    @functools.cached_property
    def _programs(self) -> tuple:
        """Programs of (leaves, branch, time): time parts, their slopes, margins in time."""
        shapes = [*self._leaves, self._branch, self._time]

        def parts(*given):
            *leaves, branch, t = given
            return self.time_parts(jax.tree.unflatten(self._tree, leaves), t, branch)

        def slopes(*given):
            *rest, t = given
            return jax.jvp(lambda t: parts(*rest, t), (t,), (jnp.ones_like(t),))[1]

        def margins(*given):
            *leaves, branch, t = given
            system = jax.tree.unflatten(self._tree, leaves)
            return self.time_conditions(system, t, branch).margins

        with jax.ensure_compile_time_eval():
            return tuple(jax.make_jaxpr(f)(*shapes) for f in (parts, slopes, margins))


def _inputs(leaves: list, t: Any, y: Any) -> list[Value]:
    return [*map(Value, leaves), Value(t, BY_TIME, 1.0), Value(y, BY_STATE, float("inf"))]


def _conditions(walk: Walk) -> Conditions:
    columns = walk.outcomes, walk.margins, walk.beyond
    return Conditions(*(jnp.concatenate([jnp.zeros(0), *parts]) for parts in columns))


def plan_of(system: PyTree, k: int, *, waves: bool = False) -> Plan:
    """The plan of a system, a pytree of its numbers with ``rate(t, y)`` of a state (k,).

    With `waves`, sines of time count among what a step may pass over: those of a rate show in the
    error that a method estimates, but nothing measures those of an event.
    """
    leaves, tree = jax.tree.flatten(system)
    return _plan(tree, tuple(map(_kind, leaves)), k, waves, jax.config.jax_enable_x64)


def _kind(x: Any) -> tuple:
    """Shape, type and weak type of numbers: those of Python take the type of what they meet."""
    return np.shape(x), jnp.result_type(x), bool(getattr(jax.typeof(x), "weak_type", False))


@functools.lru_cache(maxsize=_KINDS)
def _plan(tree, kinds: tuple, k: int, waves: bool, in_64_bits: bool) -> Plan:
    del in_64_bits  # by which a kept plan is found again
    leaves = [jax.ShapeDtypeStruct(shape, kind, weak_type=weak) for shape, kind, weak in kinds]
    t, y = (jax.ShapeDtypeStruct(shape, jnp.result_type(float)) for shape in ((), (k,)))

    def rate(*given):
        *leaves, t, y = given
        return jax.tree.unflatten(tree, leaves).rate(t, y)

    return Plan(jax.make_jaxpr(rate)(*leaves, t, y), tree, leaves, y, waves)
