"""Properties of a kind of scene, found once: its conditions, and how its rate depends on time.

A `Plan` is read from the program of a rate (by a `BranchEvaluation`), not from values at a few
points. It is the same for all scenes of a kind, whatever their numbers, and is kept with the kind.
"""

import functools
from collections.abc import Callable, Iterable
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxdyn.intervals import Interval
from jaxdyn.plan.bounds import as_interval, enclose_program
from jaxdyn.plan.continuity import Continuity, continuity
from jaxdyn.plan.evaluation import OF_TIME, BranchEvaluation, Condition, Conditions, may_switch
from jaxdyn.plan.period import period_of

#: Largest number of conditions on whose surfaces a motion may slide.
_MOST_SURFACES = 32
_KINDS = 256  # number of kinds of rates whose plans are kept


class Plan:
    """The plan of a kind of rate.

    Attributes:
      depends_on_time: whether the rate depends on time; if not, that is proved.
      conditions: the conditions, in the order in which the program meets them.
      of_time: (e,) whether each entry of a branch depends on time alone.
      bends: (e,) whether the rate is continuous where the entry changes.
      distinguishes: whether ``==`` tests for a surface in state space at which the rate jumps.
      unread: names of operations that may hide conditions.
      bounded: whether all operations on time alone have bounds.
      partial: whether a condition decides if a function that is not defined for all states, such as
        a root, has a value, or whether that value is used.
      hides: whether parts of the rate that depend on time alone may act so briefly that a step
        would pass over them.
      mixed: whether it contains functions of time and state that may act just as briefly.
    """

    def __init__(self, program: Any, tree: Any, leaves: list, y: Any, waves: bool = False):
        self._program, self._leaves, self._tree, self._state = program, leaves, tree, y
        self._time = jax.ShapeDtypeStruct((), y.dtype)
        self._waves = waves
        known = continuity(program) if may_switch(program) else Continuity()
        whole = BranchEvaluation(None, continuous=known.comparisons)
        deep = BranchEvaluation(None, every_call=True)
        part = BranchEvaluation(None, time_only=True, waves=waves)
        found = []

        def evaluate(leaves, t, y):
            rate = whole.rate(program, leaves, t, y)
            if rate.on & OF_TIME:  # most rates do not depend on time, and need no more evaluations
                part.rate(program, leaves, t, y)
                deep.rate(program, leaves, t, y)
            found.append(rate.on)
            return rate.array

        jax.eval_shape(evaluate, leaves, self._time, y)
        self.depends_on_time = bool(found[0] & OF_TIME)
        self.conditions: tuple[Condition, ...] = tuple(whole.conditions)
        entries = [c for c in self.conditions for _ in range(c.size)]
        self.of_time = np.array([c.of_time for c in entries], bool)
        self.bends = np.array([c.bends for c in entries], bool)
        self.distinguishes = known.distinguishes and self.most_surfaces > 0
        self.unread = frozenset(whole.unread)
        self.hides = bool(part.leaves)
        self.bounded = True
        if self.hides or self.of_time.any():
            unknown = self._without_bounds(self._programs, self._time)
            self.unread |= {f"{name} of time" for name in unknown}
            self.bounded = not unknown
            self.hides &= self.bounded
        self.partial = whole.partial
        self.mixed = bool(deep.mixed) and not self._without_bounds(
            [self._mixed_program], self._time, self._state
        )

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
    def jumping(self) -> np.ndarray:
        """(w,) numbers of the conditions on the state at which the rate may jump."""
        return np.flatnonzero(~(self.of_time | self.bends))[:_MOST_SURFACES]

    @property
    def most_surfaces(self) -> int:
        """Number of surfaces on which a motion may slide at once."""
        return len(self.jumping)

    @property
    def caveat(self) -> str:
        """What a motion may pass over unseen, and the remedy; empty if everything can be read."""
        unread = (
            f"The rate contains what cannot be read ({', '.join(sorted(self.unread))}): a pulse or "
            "a switch in it may have been passed over. Pass max_step=, a time that resolves it, or "
            "breaks=, the times at which it changes."
        )
        equal = (
            "The rate has a value of its own (`==`) on a surface at which it jumps, as a law of "
            "friction that is larger at rest has. A motion that slides there is on the surface up "
            "to rounding only, and may not have that value. Write sticking and sliding as phases, "
            "see jaxdyn.integrate.phases.simulate_phases."
        )
        return " ".join(filter(None, (unread * bool(self.unread), equal * self.distinguishes)))

    def period(self, system: PyTree) -> float | None:
        """The period of the rate in time; None where it has none that can be read."""
        return period_of(self._program, system)

    # Traced once for all its uses in a program, some hundred: a first motion takes a third of the
    # operations of Python (Chua's circuit: 3.2 million instead of 9.8). XLA inlines the calls.
    @functools.partial(jax.jit, static_argnums=0)
    def evaluate(self, system: PyTree, t: Array, y: Array, branch: Array | None = None):
        """The rate (k,) of a system of this kind in a branch (e,), and its `Conditions` there.

        Without a branch, it takes the branch of the outcomes at the point.
        """
        evaluation = BranchEvaluation(branch)
        rate = evaluation.rate(self._program, jax.tree.leaves(system), t, y)
        return rate.array, evaluation.found

    @functools.partial(jax.jit, static_argnums=0)
    def state_margins(self, system: PyTree, t: Array, y: Array, branch: Array) -> Array:
        """(e,) the margins of conditions on the state in a branch (e,), 1 for those on time alone.

        The margins of the latter, as in a table, are the larger part of many programs.
        """
        evaluation = BranchEvaluation(branch, state_only=True)
        evaluation.rate(self._program, jax.tree.leaves(system), t, y)
        return evaluation.found.margins

    def time_parts(self, system: PyTree, t: Array, branch: Array | None) -> Array:
        """(u,) the parts of the rate that depend on time alone, in a branch (e,)."""
        parts = [jnp.asarray(x.array, float) for x in self._in_time(system, t, branch).leaves]
        return jnp.concatenate([jnp.zeros(0), *map(jnp.ravel, parts)])

    def time_conditions(self, system: PyTree, t: Array, branch: Array | None) -> Conditions:
        """The conditions that depend on time alone, in a branch (e,)."""
        return self._in_time(system, t, branch).found

    def _in_time(self, system: PyTree, t: Array, branch: Array | None) -> BranchEvaluation:
        given = None if branch is None else branch[np.flatnonzero(self.of_time)]
        evaluation = BranchEvaluation(given, time_only=True, waves=self._waves)
        evaluation.rate(self._program, jax.tree.leaves(system), t, None)
        return evaluation

    def mixed_parts(self, system: PyTree, t: Array, y: Array, branch: Array) -> Array:
        """(2, m) the arguments and values of functions of time and state that may act briefly."""
        evaluation = BranchEvaluation(branch, every_call=True)
        evaluation.rate(self._program, jax.tree.leaves(system), t, y)
        rows = (evaluation.mixed[i::2] for i in (0, 1))
        return jnp.stack([jnp.concatenate([jnp.ravel(x.array) for x in row]) for row in rows])

    def bounds_of_parts(
        self, system: PyTree, low: Array, high: Array, branch: Array
    ) -> tuple[Interval, Array]:
        """(u,) bounds of `time_parts` from one time to another, and of the size of their slopes.

        The bounds are the intersection of those by interval arithmetic and of the mean value form.
        """
        parts, slopes, _ = self._programs
        plain = _bounds(parts, system, Interval(low, high), branch)
        slope = _bounds(slopes, system, Interval(low, high), branch)
        middle = _bounds(parts, system, 0.5 * (low + high), branch).low
        steepest = jnp.maximum(jnp.abs(slope.low), jnp.abs(slope.high))
        steepest = jnp.where(jnp.isnan(steepest), jnp.inf, steepest)
        most = 0.5 * (high - low) * steepest
        most = jnp.where(jnp.isnan(most), jnp.inf, most)
        low, high = jnp.maximum(plain.low, middle - most), jnp.minimum(plain.high, middle + most)
        return Interval(low, high), steepest

    def bounds_of_margins(self, system: PyTree, low: Array, high: Array, branch: Array) -> Interval:
        """Bounds of the margins of `time_conditions` from one time to another."""
        return _bounds(self._programs[2], system, Interval(low, high), branch)

    def bounds_of_mixed(self, system: PyTree, t: Interval, y: Interval, branch: Array) -> Interval:
        """(2, m) bounds of `mixed_parts` over times () and states (k,)."""
        return _bounds(self._mixed_program, system, t, y, branch)

    def bounds_of_rate(self, system: PyTree, low: Array, high: Array, y: Array) -> Interval:
        """(k,) bounds of the rate at a state from one time to another."""
        return _bounds(self._program, system, Interval(low, high), y)

    @functools.cached_property
    def _programs(self) -> tuple:
        """Programs of (system, time, branch): time parts, their slopes, margins in time."""

        def slopes(system, t, branch):
            parts = lambda t: self.time_parts(system, t, branch)  # noqa: E731
            return jax.jvp(parts, (t,), (jnp.ones_like(t),))[1]

        def margins(*given):
            return self.time_conditions(*given).margins

        return tuple(self._trace(f, self._time) for f in (self.time_parts, slopes, margins))

    @functools.cached_property
    def _mixed_program(self):
        return self._trace(self.mixed_parts, self._time, self._state)

    def _trace(self, function: Callable, *shapes: Any):
        """The program of a function of a system, of values of these shapes, and of a branch."""

        def of_leaves(*given):
            n = len(self._leaves)
            return function(jax.tree.unflatten(self._tree, given[:n]), *given[n:])

        with jax.ensure_compile_time_eval():
            return jax.make_jaxpr(of_leaves)(*self._leaves, *shapes, self._branch)

    def _without_bounds(self, programs: Iterable, *shapes: Any) -> set[str]:
        """Names of operations that have no bounds where values of these shapes are intervals."""
        unknown: set[str] = set()

        def enclose(leaves, moving, branch):
            for program in programs:
                enclose_program(program, [*leaves, *moving, branch], unknown)

        moving = [Interval(shape, shape) for shape in shapes]
        jax.eval_shape(enclose, self._leaves, moving, self._branch)
        return unknown


def _bounds(program: Any, system: PyTree, *values: Any) -> Interval:
    """Bounds of the result of a program of a system's numbers and these values or intervals."""
    (found,) = enclose_program(program, [*jax.tree.leaves(system), *values])
    return as_interval(found)


@runtime_checkable
class Wrapper(Protocol):
    """A field around another, such as its variational equations, or the field with noise.

    Attributes:
      field: the inner field.
    """

    field: Any

    def around(self, change, branch: Any) -> Any:
        """The same wrapper around ``change(field, branch)``."""


def without_wrappers(field: Any) -> Any:
    """The field below all wrappers."""
    while isinstance(field, Wrapper):
        field = field.field
    return field


def plan_of(field: PyTree, k: int, *, waves: bool = False) -> Plan:
    """The plan of a field, a pytree of its numbers with ``rate(t, y)`` of a state (k,).

    A wrapper of a field, such as its variational equations, has the plan of the field itself.

    With `waves`, sines of time count among what a step may pass over: in a rate they show in the
    error that a method estimates, but nothing measures those in an event.
    """
    leaves, tree = jax.tree.flatten(without_wrappers(field))
    return _plan(tree, tuple(map(_kind, leaves)), k, waves, jax.config.jax_enable_x64)


def _kind(x: Any) -> tuple:
    """Shape, type and weak type of numbers: those of Python take the type of other operands."""
    return np.shape(x), jnp.result_type(x), bool(getattr(jax.typeof(x), "weak_type", False))


@functools.lru_cache(maxsize=_KINDS)
def _plan(tree, kinds: tuple, k: int, waves: bool, in_64_bits: bool) -> Plan:
    del in_64_bits  # part of the cache's key only
    leaves = [jax.ShapeDtypeStruct(shape, kind, weak_type=weak) for shape, kind, weak in kinds]
    t, y = (jax.ShapeDtypeStruct(shape, jnp.result_type(float)) for shape in ((), (k,)))

    def rate(*given):
        *leaves, t, y = given
        return jax.tree.unflatten(tree, leaves).rate(t, y)

    return Plan(jax.make_jaxpr(rate)(*leaves, t, y), tree, leaves, y, waves)
