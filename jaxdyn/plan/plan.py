"""What is true of a kind of scene, found once: its conditions, and how its rate depends on time.

A `Plan` is read from the program of a rate (by a `BranchEvaluation`), not from values at a few
points. It is the same for all scenes of a kind, whatever their numbers, and is kept with the kind.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxdyn._numerics import SMOOTH, solve_spd
from jaxdyn._programs import CALLS, Loop, bind, inner_program, live_operations, loop
from jaxdyn.intervals import Interval
from jaxdyn.plan.bounds import as_interval, enclose_program
from jaxdyn.plan.period import period_of
from jaxdyn.scales import Groups


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
      bends: (e,) likewise whether the rate is continuous where it changes.
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
        found: list[BranchEvaluation] = []
        results: list[int] = []

        def evaluate(leaves, t, y):
            whole = BranchEvaluation(None)
            (rate,) = whole.program(program, _inputs(leaves, t, y))
            results.append(rate.on)
            part = BranchEvaluation(None, time_only=True, waves=waves)
            deep = BranchEvaluation(None, every_call=True)
            if rate.on & OF_TIME:  # most rates do not depend on time, and need no more of them
                part.results(part.program(program, _inputs(leaves, t, y)))
                deep.program(program, _inputs(leaves, t, y))
            found.extend([whole, part, deep])
            return rate.array

        jax.eval_shape(evaluate, leaves, self._time, y)
        whole, part, deep = found
        self.depends_on_time = bool(results[0] & OF_TIME)
        self.conditions: tuple[Condition, ...] = tuple(whole.conditions)
        sides = [np.full(c.size, c.of_time) for c in self.conditions]
        self.of_time = np.concatenate([np.zeros(0, bool), *sides])
        bends = [np.full(c.size, c.bends) for c in self.conditions]
        self.bends = np.concatenate([np.zeros(0, bool), *bends])
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
    def jumping(self) -> np.ndarray:
        """(w,) numbers of the conditions on the state at which the rate may jump."""
        return np.flatnonzero(~(self.of_time | self.bends))[:_MOST_SURFACES]

    @property
    def most_surfaces(self) -> int:
        """Number of surfaces on which a motion may slide at once."""
        return len(self.jumping)

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

    # Traced once for all its uses in a program, some hundred: a third of the operations of
    # Python until a first motion (Chua's circuit: 3.2 million, not 9.8). XLA inlines the calls.
    @functools.partial(jax.jit, static_argnums=0)
    def evaluate(self, system: PyTree, t: Array, y: Array, branch: Array | None = None):
        """The rate (k,) of a system of this kind in a branch (e,), and its `Conditions` there.

        Without a branch, it takes the branch of the outcomes at the point.
        """
        evaluation = BranchEvaluation(branch)
        leaves = jax.tree.leaves(system)
        (rate,) = evaluation.program(self._program, _inputs(leaves, t, y))
        return rate.array, _conditions(evaluation)

    def time_parts(self, system: PyTree, t: Array, branch: Array | None) -> Array:
        """(u,) the parts of the rate that depend on time alone, in a branch (e,)."""
        return jnp.concatenate([jnp.zeros(0), *map(jnp.ravel, self._in_time(system, t, branch)[0])])

    def time_conditions(self, system: PyTree, t: Array, branch: Array | None) -> Conditions:
        """The conditions that depend on time alone, in a branch (e,)."""
        return self._in_time(system, t, branch)[1]

    def _in_time(self, system: PyTree, t: Array, branch: Array | None):
        given = None if branch is None else branch[np.flatnonzero(self.of_time)]
        evaluation = BranchEvaluation(given, time_only=True, waves=self._waves)
        leaves = jax.tree.leaves(system)
        evaluation.results(evaluation.program(self._program, _inputs(leaves, t, None)))
        return [jnp.asarray(x.array, float) for x in evaluation.leaves], _conditions(evaluation)

    def bounds_of_parts(
        self, system: PyTree, low: Array, high: Array, branch: Array
    ) -> tuple[Interval, Array]:
        """(u,) bounds of `time_parts` from one time to another, and of the size of their slopes.

        The bounds are the narrower of those of the formulas and those by slopes about the middle.
        """
        given = [*jax.tree.leaves(system), branch]
        parts, slopes, _ = self._programs
        (plain,) = enclose_program(parts, [*given, Interval(low, high)])
        (slope,) = enclose_program(slopes, [*given, Interval(low, high)])
        plain, slope = as_interval(plain), as_interval(slope)
        middle = as_interval(enclose_program(parts, [*given, 0.5 * (low + high)])[0]).low
        steepest = jnp.maximum(jnp.abs(slope.low), jnp.abs(slope.high))
        steepest = jnp.where(jnp.isnan(steepest), jnp.inf, steepest)
        most = 0.5 * (high - low) * steepest
        most = jnp.where(jnp.isnan(most), jnp.inf, most)
        low, high = jnp.maximum(plain.low, middle - most), jnp.minimum(plain.high, middle + most)
        return Interval(low, high), steepest

    def mixed_parts(self, system: PyTree, t: Array, y: Array, branch: Array) -> Array:
        """(2, m) the arguments and values of functions of time and state that may act briefly."""
        evaluation = BranchEvaluation(branch, every_call=True)
        evaluation.program(self._program, _inputs(jax.tree.leaves(system), t, y))
        rows = (evaluation.mixed[i::2] for i in (0, 1))
        return jnp.stack([jnp.concatenate([jnp.ravel(x.array) for x in row]) for row in rows])

    def bounds_of_mixed(self, system: PyTree, t: Interval, y: Interval, branch: Array) -> Interval:
        """(2, m) bounds of `mixed_parts` over times () and states (k,)."""
        (found,) = enclose_program(self._mixed_program, [*jax.tree.leaves(system), branch, t, y])
        return as_interval(found)

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
            enclose_program(
                self._mixed_program, [*known, Interval(t, t), Interval(low, high)], unknown
            )
            return t

        jax.eval_shape(enclose, *self._leaves, self._branch, self._state, self._state, self._time)
        return unknown

    def bounds_of_rate(self, system: PyTree, low: Array, high: Array, y: Array) -> Interval:
        """(k,) bounds of the rate at a state from one time to another."""
        given = [*jax.tree.leaves(system), Interval(low, high), y]
        return as_interval(enclose_program(self._program, given)[0])

    def _without_bounds(self) -> frozenset[str]:
        """Names of operations on time alone that have no bounds."""
        unknown: set[str] = set()

        def enclose(*given):
            *known, low, high = given
            for program in self._programs:
                enclose_program(program, [*known, Interval(low, high)], unknown)
            return low

        jax.eval_shape(enclose, *self._leaves, self._branch, self._time, self._time)
        return frozenset(unknown)

    def bounds_of_margins(self, system: PyTree, low: Array, high: Array, branch: Array) -> Interval:
        """Bounds of the margins of `time_conditions` from one time to another."""
        given = [*jax.tree.leaves(system), branch]
        (found,) = enclose_program(self._programs[2], [*given, Interval(low, high)])
        return as_interval(found)

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


def _inputs(leaves: list, t: Any, y: Any) -> list["Value"]:
    return [*map(Value, leaves), Value(t, BY_TIME, 1.0), Value(y, BY_STATE, float("inf"))]


def _conditions(evaluation: "BranchEvaluation") -> Conditions:
    columns = evaluation.outcomes, evaluation.margins, evaluation.beyond
    outcomes, margins, beyond = (jnp.concatenate(parts or [jnp.zeros(0)]) for parts in columns)
    far = _FAR * jnp.finfo(margins.dtype).max
    margins = jnp.where(margins == margins, jax.lax.clamp(-far, margins, far), far)
    return Conditions(outcomes, margins, beyond)


def plan_of(field: PyTree, k: int, *, waves: bool = False) -> Plan:
    """The plan of a field, a pytree of its numbers with ``rate(t, y)`` of a state (k,).

    A wrapper of a field, such as its variational equations, has the plan of the field itself.

    With `waves`, sines of time count among what a step may pass over: those of a rate show in the
    error that a method estimates, but nothing measures those of an event.
    """
    leaves, tree = jax.tree.flatten(without_wrappers(field))
    return _plan(tree, tuple(map(_kind, leaves)), k, waves, jax.config.jax_enable_x64)


def _kind(x: Any) -> tuple:
    """Shape, type and weak type of numbers: those of Python take the type of what they meet."""
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


# ---- A field in one branch of its conditions, or sliding along the surfaces between some
#
# `in_branch` puts the branch below whatever wraps a field, such as its variational equations. A
# motion that is pushed back to a surface from both sides slides along it (Filippov, 1988,
# Differential Equations with Discontinuous Righthand Sides): its rate is the weighted mean of the
# rates on both sides that is tangent to the surface. On several surfaces at once each has a weight
# of its own, and the rate is f + sum of w_j (f_j - f), with f behind all of them and f_j before
# surface j alone. This is exact where the jumps at the surfaces add up, as those of dry friction in
# several places do; where they do not, Filippov's rate is not unique, and the motion ends.


class Branch(NamedTuple):
    """The outcomes of the conditions of a rate along a piece of a motion.

    Attributes:
      outcomes: (e,) outcomes of all conditions; for those of a surface of sliding, on the side
        behind it, to which the motion was going.
      before: (e,) likewise on the side from which it came.
      surfaces: (w, e) whether each condition changes on the surface of sliding of each condition
        in `Plan.jumping`; of those on one surface only the first has a row.
    """

    outcomes: Array
    before: Array
    surfaces: Array

    @classmethod
    def of(cls, outcomes: Array, rows: int) -> "Branch":
        """Outcomes of a motion that does not slide; `rows` is the plan's `Plan.most_surfaces`."""
        return cls(outcomes, outcomes, jnp.zeros((rows, len(outcomes)), bool))

    @property
    def slides(self) -> Array:
        """Whether () the motion slides."""
        return self.surfaces.any()

    @property
    def surface(self) -> Array:
        """(e,) whether each condition changes on any surface of sliding."""
        return self.surfaces.any(0)


class Balance(NamedTuple):
    """The rates on all sides of some surfaces that a state lies on, and how fast they lead away.

    Attributes:
      rates: (w + 1, k) the rate behind all surfaces, then that before each surface alone.
      slopes: (w,) of the margin of each surface behind it, along the first rate.
      gains: (w, w) by how much each slope is larger along the rate before each surface.
    """

    rates: Array
    slopes: Array
    gains: Array

    @property
    def weights(self) -> Array:
        """(w,) of the rates before the surfaces, such that the mean is tangent to all of them."""
        if len(self.slopes) == 1:
            return -self.slopes / self.gains[0]
        return solve_spd(self.gains, -self.slopes)

    def mean(self, weights: Array) -> Array:
        """(k,) the rate for given weights (w,)."""
        jumps = self.rates[1:] - self.rates[:1]
        return self.rates[0] + jnp.sum(weights[:, None] * jumps, 0)

    def slopes_for(self, weights: Array) -> Array:
        """(w,) the slopes for given weights (w,), each surface's own weight being 0."""
        own = jnp.diag(self.gains)
        return self.slopes + jnp.sum(self.gains * weights[None], 1) - own * weights

    def settle(self, way: Array) -> Array:
        """(w,) the weights between 0 and 1 with which the motion goes on in the direction `way`.

        On each surface, with those of the others, it stays behind if it is led away from there;
        else it returns if it is led away on the side before; else it slides. Projected relaxation
        finds weights that agree (Cottle, Pang, Stone, 1992, The Linear Complementarity Problem).
        """
        slopes, gains, w = way * self.slopes, way * self.gains, len(self.slopes)

        def relax(i, weights):
            this, own = jnp.arange(w) == i % w, gains[i % w, i % w]
            behind = slopes[i % w] + jnp.sum(jnp.where(this, 0.0, gains[i % w] * weights))
            share = jnp.where(behind + own <= 0, 1.0, -behind / own)
            return jnp.where(this, jnp.where(behind >= 0, 0.0, share), weights)

        return jax.lax.fori_loop(0, 1 if w == 1 else _RELAXATIONS * w, relax, jnp.zeros(w))


#: Number of rounds of relaxation: enough for surfaces coupled by 0.9, the error of which is 1e-5.
_RELAXATIONS = 100
#: Roundings of the rates on both sides up to which their mean is zero.
_ROUNDINGS = 8
#: Largest number of conditions on whose surfaces a motion may slide.
_MOST_SURFACES = 32


@runtime_checkable
class Wrapper(Protocol):
    """A field around another, such as its variational equations, or the field with noise.

    Attributes:
      field: the inner field.
    """

    field: Any

    def around(self, change, branch: Any) -> Any:
        """The same wrapper around ``change(field, branch)``."""


def in_branch(field: Any, branch: Any) -> Any:
    """A field in a branch, inside the same wrappers."""
    if isinstance(field, Wrapper):
        return field.around(in_branch, branch)
    return InBranch(field, branch)


def without_wrappers(field: Any) -> Any:
    """The field of a system, below its variational equations and noise."""
    while isinstance(field, Wrapper | InBranch):
        field = field.field
    return field


def jump(field: Any, t: Array, y: Array, old: Branch, new: Branch, which: Array) -> Array:
    """A state with tangents after a switch, as the outermost wrapper of a field changes it.

    Args:
      field: see `flow`.
      t: () time of the switch.
      y: (k, ...) state before.
      old: branch before.
      new: branch after.
      which: () number of the condition that changes.
    """
    change = getattr(field, "jump", None)
    return y if change is None else change(t, y, old, new, which)


class InBranch(NamedTuple):
    """A field whose conditions have given outcomes.

    Attributes:
      field: has ``rate``, ``project``, ``undetermined`` and ``loses``; a pytree of its numbers.
      branch: see `Branch`.
    """

    field: Any
    branch: Branch

    @property
    def system(self) -> Any:
        """The system of the field."""
        return self.field.system

    @property
    def groups(self) -> Groups:
        """Which entries of the state share a size."""
        return self.field.groups

    def rate(self, t: Array, y: Array) -> Array:
        """The rate (k,) in the branch."""
        plan = plan_of(self.field, len(y))
        if not plan.on_state:
            return self._plain(t, y)
        # Also where it cannot slide: a choice is not rewritten by `simplify`, which would expand
        # k (d - clip(d)) and leave its rounding as a force within the play of two gears.
        slide = self._sliding if plan.most_surfaces else self._plain
        return jax.lax.cond(self.branch.slides, slide, self._plain, t, y)

    def _plain(self, t: Array, y: Array) -> Array:
        return self.side(t, y, self.branch.outcomes)[0]

    def _sliding(self, t: Array, y: Array) -> Array:
        balance = self.balance(t, y)
        mean = balance.mean(balance.weights)
        # What rounding leaves of forces in balance would be the size of a motion from rest.
        rounding = _ROUNDINGS * jnp.finfo(y.dtype).eps * jnp.max(jnp.abs(balance.rates), 0)
        return mean - jax.lax.stop_gradient(jnp.where(jnp.abs(mean) <= rounding, mean, 0.0))

    def balance(self, t: Array, y: Array) -> Balance:
        """The rates on all sides of the surfaces of the branch, and how fast they lead away.

        Rows without a surface have a weight of 0: each is balanced by itself.
        """
        outcomes, before, surfaces = self.branch
        held, first = surfaces.any(1), jnp.argmax(surfaces, 1)

        def margins(t, y):
            return self.side(t, y, outcomes)[1].margins

        def look(side):
            rate = self.side(t, y, side)[0]
            return rate, jax.jvp(margins, (t, y), (jnp.ones_like(t), rate))[1][first]

        sides = jnp.where(surfaces, before[None], outcomes[None])
        sides = jnp.concatenate([outcomes[None], sides])
        # For two rates a loop takes longer to compile than a copy of the program.
        each = _in_turn if len(sides) == 2 else jax.vmap
        rates, slopes = each(look)(sides)
        gains = jnp.where(
            held[:, None] & held[None], (slopes[1:] - slopes[:1]).T, jnp.eye(len(held))
        )
        return Balance(rates, jnp.where(held, slopes[0], 0.0), gains)

    def side(self, t: Array, y: Array, outcomes: Array) -> tuple[Array, Conditions]:
        """The rate, and the conditions, for other outcomes.

        Beyond a surface where a branch is not defined, as max(0, -x)^1.5 for x > 0, the rate is the
        one that the program gives there: a trial step may pass a little beyond the surface.
        """
        plan = plan_of(self.field, len(y))
        rate, conditions = plan.evaluate(self.field, t, y, outcomes)
        if plan.partial:
            # A choice between two rates would have a NaN derivative if either one's is NaN.
            here = plan.evaluate(self.field, t, y)[1].outcomes
            outcomes = jnp.where(jnp.isnan(rate).any(), here, outcomes)
            rate = plan.evaluate(self.field, t, y, outcomes)[0]
        return rate, conditions

    def margins(self, t: Array, y: Array) -> Array:
        """(e + 2 w,) numbers: the branch ends where one of them falls through 0.

        They are the margins of the conditions on the state and, for a sliding motion, the weights
        of the rates behind each surface, then of those before, each times the push of both.
        """
        plan, branch = plan_of(self.field, len(y)), self.branch
        margins = self.side(t, y, branch.outcomes)[1].margins
        margins = jnp.where(plan.of_time | branch.surface, 1.0, margins)
        return jnp.concatenate([margins, self._weights(t, y)]) if plan.most_surfaces else margins

    def _weights(self, t: Array, y: Array) -> Array:
        rows = len(self.branch.surfaces)
        none = lambda t, y: jnp.ones(2 * rows)  # noqa: E731
        return jax.lax.cond(self.branch.slides, self._pushes, none, t, y)

    def _pushes(self, t: Array, y: Array) -> Array:
        # Weights would be 0/0 where a surface does not push at all. Of one surface no weight is
        # needed, so that its sides are compared as they are.
        balance = self.balance(t, y)
        own, weights = jnp.diag(balance.gains), balance.weights
        weights = jnp.zeros(1) if len(own) == 1 else weights
        before = -balance.slopes_for(weights)
        pushes = jnp.concatenate([own - before, before]) * jnp.tile(jnp.sign(own), 2)
        return jnp.where(jnp.tile(self.branch.surfaces.any(1), 2), pushes, 1.0)

    def change(self, t: Array, y: Array, which: Array, slid: bool) -> Array:
        """() the function whose zero ended the branch, smooth on both sides.

        Args:
          t: () time.
          y: (k,) state.
          which: () its number, as in `margins`.
          slid: whether it may be an end of sliding.
        """
        margins = self.side(t, y, self.branch.outcomes)[1].margins
        if slid and len(self.branch.surfaces):
            margins = jnp.concatenate([margins, self._weights(t, y)])
        return margins[which]

    def project(self, t: Array, y: Array) -> Array:
        """The nearest state that satisfies the system's constraints."""
        return self.field.project(t, y)

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """Whether () the constraints leave the acceleration undetermined at a state (k,)."""
        return self.field.undetermined(t, y)

    def loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array | None:
        """Whether () a step may pass a state that leaves the acceleration undetermined."""
        return self.field.loses(t0, y0, t1, y1)


def _in_turn(function: Callable) -> Callable:
    """As `jax.vmap`, with a copy of the program for each row."""
    return lambda rows: jax.tree.map(lambda *found: jnp.stack(found), *map(function, rows))


# ---- A rate in one branch: every condition of its program keeps an outcome that is given
#
# A rate with conditions (``where``, ``sign``, ``abs``, ``max``, ``floor``, ``mod``, tables, ...) is
# smooth between the times at which one of them changes. `BranchEvaluation` repeats the program of a
# rate with the outcome of each condition as an argument, the branch, so that a step across such a
# time is not affected by the other side. Besides the rate it returns how far each condition is from
# changing, its margin, and the outcomes that hold at the point.
#
# What a condition is, and its margin:
#
# - a comparison a < b: b - a where it holds, a - b where it does not; ``max``, ``min``, ``abs``,
#   ``sign`` and ``clamp`` are made of comparisons;
# - ``floor``, ``ceil``, ``round``, ``rem``, a conversion to integers: the distance from the next
#   whole number;
# - the place of a number in a table (``searchsorted``, and so ``interp``): the distance to the
#   nearest of the two knots beside it;
# - which of several numbers is the largest or the smallest: how far it is from the next one; the
#   order of a few numbers is made of comparisons.
#
# Equality does not count as a condition: programs test it to guard a removable singularity, and it
# holds at single points only. But derivatives of ``max`` and ``min`` use it to find the operand
# that was taken, also on the surface, where steps end and both are equal: there the branch decides.
# Conditions on numbers of the scene alone are evaluated as they are. Those within loops of unknown
# length, and choices such as the pivots of a linear system, cannot be read;
# `BranchEvaluation.unread` names them.

#: What a value depends on: time and state, so that it moves along a motion, or only outcomes of
#: conditions, so that it jumps, and is constant in a branch.
BY_TIME, BY_STATE, JUMPS_IN_TIME, JUMPS_WITH_STATE = 1, 2, 4, 8
_MOVES = BY_TIME | BY_STATE
OF_TIME, OF_STATE = BY_TIME | JUMPS_IN_TIME, BY_STATE | JUMPS_WITH_STATE

_COMPARISONS = ("lt", "le", "gt", "ge", "lt_to", "le_to")
_TABLE = "searchsorted"
#: Functions of JAX whose conditions only choose the formula with the least rounding.
_SMOOTH_OF_JAX = frozenset({"hypot", "sinc", "softplus", "log_softmax"})
#: Largest number of rounds for which a loop with conditions is unrolled.
_LONGEST_LOOP = 100
#: Largest number of entries in a sort that is read.
_LONGEST_ROW = 20
#: Operations on floats whose conditions are not read.
_UNREAD = frozenset({"sort", "cummax", "cummin", "top_k", "reduce_window_max", "reduce_window_min"})
#: Margin of a condition that has none, such as at infinity, as a part of the largest float.
_FAR = 1e-8


class Value(NamedTuple):
    """A value of a program.

    Attributes:
      array: the value; None where it is not computed.
      on: what it depends on: `BY_TIME`, `BY_STATE`, `JUMPS_IN_TIME` and `JUMPS_WITH_STATE`, joined
        by ``|``; 0 for a value that depends on none of these.
      degree: its degree as a polynomial in time, where it depends on time alone; infinite if it is
        not a polynomial.
    """

    array: Any
    on: int = 0
    degree: float = 0.0


class Condition(NamedTuple):
    """A condition of a program, or several in one array.

    Attributes:
      kind: "compare", "whole", "table" or "extreme".
      on: what it depends on, see `Value`.
      size: number of its entries.
      bends: whether values are continuous where it changes, as those of ``max``.
    """

    kind: str
    on: int
    size: int
    bends: bool = False

    @property
    def of_time(self) -> bool:
        """Whether it depends on time and not on the state."""
        return not self.on & OF_STATE


class BranchEvaluation:
    """One evaluation of a program in a branch.

    Args:
      branch: (e,) outcomes; None for those that hold at the point.
      time_only: leave out what depends on the state.
      every_call: enter every function that is called, though its own rule for derivatives is lost.
      waves: note sines of time as well among the parts that a step may pass over.

    Attributes:
      conditions: the conditions met so far.
      outcomes: the outcomes of each, as a vector; likewise `margins`, and outcomes `beyond`.
      unread: names of operations that may hide conditions.
      partial: whether a function of the state is not defined everywhere, such as a root.
      leaves: values of time alone that meet the state, or are a result.
      mixed: arguments and values, in turn, of functions of time and state that may be flat except
        in a brief part of a motion.
    """

    def __init__(
        self,
        branch: Array | None,
        time_only: bool = False,
        every_call: bool = False,
        waves: bool = False,
    ):
        self.branch, self.time_only, self.waves = branch, time_only, waves
        self.every_call = every_call or time_only
        self.conditions: list[Condition] = []
        self.outcomes: list[Array] = []
        self.margins: list[Array] = []
        self.beyond: list[Array] = []
        self.unread: set[str] = set()
        self.partial = False
        self.leaves: list[Value] = []
        self.mixed: list[Value] = []
        self._made: dict[int, tuple[str, list[Value]]] = {}
        self._kept: list[Value] = []
        self._taken: dict[int, tuple[Array, Value, Value, Value, int]] = {}
        self._compared: list[tuple[Value, Value]] = []

    @property
    def size(self) -> int:
        """Number of entries of a branch so far."""
        return sum(c.size for c in self.conditions)

    def program(self, closed, args: Sequence[Value]) -> list[Value]:
        """The results of a program."""
        return self._program(closed.jaxpr, [Value(c) for c in closed.consts], args)

    def _program(self, jaxpr, consts, args) -> list[Value]:
        values = dict(zip(jaxpr.constvars, consts, strict=True))
        values |= dict(zip(jaxpr.invars, args, strict=True))

        def read(atom) -> Value:
            if isinstance(atom, jax.extend.core.Literal):
                return Value(atom.val)
            return values[atom]

        # A condition whose outcome is thrown away would end steps and take long to compile: the
        # work of an effect, whose error is measured by the magnitudes of its terms, took 26 s.
        for eqn in live_operations(jaxpr):
            found = self._apply(eqn, [read(a) for a in eqn.invars])
            values |= dict(zip(eqn.outvars, found, strict=True))
        return [read(a) for a in jaxpr.outvars]

    def _apply(self, eqn, args: list[Value]) -> list[Value]:
        name, params = eqn.primitive.name, eqn.params
        on = functools.reduce(lambda a, b: a | b.on, args, 0)
        if on & _MOVES:
            rule = _RULES.get(name)
            if rule is not None and _is_condition(eqn):
                found = rule(self, eqn, args)
                return found if isinstance(found, list) else [found]
            if name in CALLS:
                if params.get("name") == _TABLE and not args[0].on & _MOVES:
                    # In its derivative the tangents of both follow; the result is the same.
                    return [self._table(*args[:2])]
                inner = inner_program(eqn)
                # Calls are entered also to follow nothing but the degrees of polynomials in time.
                enter = _may_switch(inner) or (self.every_call and on & BY_TIME)
                name = str(params.get("name", ""))
                if enter and not (name.startswith(SMOOTH) or name in _SMOOTH_OF_JAX):
                    return self.program(inner, args)
            elif name == "cond" and _may_switch(*params["branches"]):
                return self._choose(params["branches"], args)
            elif name == "scan" and _may_switch(params["jaxpr"]):
                known = loop(eqn)
                if known is not None and known.length <= _LONGEST_LOOP:
                    return self._unroll(eqn, known, args)
                self.unread.add("a loop of many rounds with conditions")
            elif name == "while" and _may_switch(params["body_jaxpr"], params["cond_jaxpr"]):
                self.unread.add("a loop of unknown length")
            elif name == "eq" and (taken := self._operand(*args)) is not None:
                return [Value(taken, on, math.inf)]
            elif name == "eq" and self._are_apart(*args):
                return [Value(jnp.zeros(eqn.outvars[0].aval.shape, bool), on, math.inf)]
        return self._as_it_stands(eqn, args, on)

    def take(self, which: Array, no: Value, yes: Value, found: Value) -> None:
        """Note that a result of ``max`` or ``min`` is the operand that an outcome chooses."""
        if found.array is not None:
            self._taken[id(found.array)] = which, no, yes, found, len(self.conditions) - 1

    def compare(self, a: Value, b: Value) -> None:
        """Note that an outcome says which of two values is the larger one."""
        if self.branch is not None:
            self._compared.append((a, b))

    def _are_apart(self, a: Value, b: Value) -> bool:
        """Whether an outcome says which is larger: then a branch takes them as never equal.

        So the derivatives of ``max`` and ``min`` are those of the branch, though the rules of JAX
        0.11 and newer take half of both where the operands are equal.
        """
        return any(
            (_is_same(a, x) and _is_same(b, y)) or (_is_same(a, y) and _is_same(b, x))
            for x, y in self._compared
        )

    def _operand(self, a: Value, b: Value) -> Array | None:
        """Whether one value is the operand that was taken for the other, a maximum or minimum.

        The rules for derivatives of JAX 0.10 and older ask for it: such a derivative jumps.
        """
        for x, of in ((a, b), (b, a)):
            if id(of.array) in self._taken:
                which, no, yes, _, number = self._taken[id(of.array)]
                if _is_same(x, yes) or _is_same(x, no):
                    self.conditions[number] = self.conditions[number]._replace(bends=False)
                    if self.branch is not None:
                        return which > 0.5 if _is_same(x, yes) else which <= 0.5
        return None

    def _as_it_stands(self, eqn, args: list[Value], on: int) -> list[Value]:
        if _is_callback(eqn):
            # It counts as depending on the state, so that it is not evaluated ahead of the motion.
            self.unread.add("a call of Python")
            on |= BY_STATE
        elif _is_unread(eqn) and on & _MOVES:
            self.unread.add(eqn.primitive.name)
        if on & OF_STATE:
            for x in args:
                self._meets_state(x)
        if self.time_only and on & OF_STATE:
            return [Value(None, on, math.inf) for _ in eqn.outvars]
        if eqn.primitive.name == "mul" and any(map(_is_zero, args)):
            on = 0  # as in code that makes a zero with the type and shape of another number
        self.partial |= eqn.primitive.name in _PARTIAL and bool(args[0].on & BY_STATE)
        waves = self.waves and eqn.primitive.name in _WAVES
        degree = _degree(eqn.primitive.name, eqn.params, args) if on & BY_TIME else 0.0
        degree = math.inf if on & BY_TIME and waves else degree
        found = bind(eqn, [x.array for x in args])
        made = [Value(x, on, degree) for x in found]
        if eqn.primitive.name in _BRIEF and args[0].on & BY_TIME and args[0].on & BY_STATE:
            self.mixed += [args[0], *made]
        if self.time_only and on & BY_TIME:
            for value in made:
                self._made[id(value.array)] = (eqn.primitive.name, args)
                self._kept.append(value)
        return made

    def _meets_state(self, x: Value) -> None:
        """Note a value of time alone that an operation on the state uses, term by term."""
        if not x.on & BY_TIME or x.on & OF_STATE or x.degree <= _TRIVIAL_DEGREE:
            return
        name, args = self._made.get(id(x.array), ("", []))
        scaled = name in _SCALES and sum(bool(part.on & BY_TIME) for part in args) == 1
        if name in _TERM_BY_TERM or (scaled and not (name == "div" and args[1].on & BY_TIME)):
            for part in args:
                self._meets_state(part)
        elif not any(x.array is leaf.array for leaf in self.leaves):
            self.leaves.append(x)

    def results(self, values: Sequence[Value]) -> None:
        """Note the results of the program, which meet the state as well."""
        for x in values:
            self._meets_state(x)

    def condition(
        self,
        kind: str,
        args: list[Value],
        at: Callable,
        shape: tuple[int, ...] | None = None,
        bends: bool = False,
    ) -> tuple[Any, int]:
        """The outcome of a condition in the branch, and what it depends on.

        Args:
          kind: see `Condition`.
          args: its arguments.
          at: a function of the outcome in the branch, or of None for the one at the point; returns
            the outcome at the point, the margin of the outcome in the branch, and the one beyond.
          shape: shape of the outcomes; by default that to which the arguments are broadcast.
          bends: see `Condition`.
        Returns:
          None for the outcome where only what depends on time is computed.
        """
        moves = functools.reduce(lambda a, b: a | b.on, args, 0)
        on = moves | ((moves & _MOVES) << 2)
        jumps = on & (JUMPS_IN_TIME | JUMPS_WITH_STATE)
        if self.time_only and on & OF_STATE:
            for x in args:
                self._meets_state(x)
            return None, jumps
        if shape is None:
            shape = np.broadcast_shapes(*(np.shape(x.array) for x in args))
        first, size = self.size, math.prod(shape)
        given = None
        if self.branch is not None:
            given = self.branch[first : first + size].reshape(shape)
        here, margin, beyond = at(given)
        self.conditions.append(Condition(kind, on, size, bends))
        flat = lambda x: jnp.broadcast_to(x, shape).astype(float).ravel()  # noqa: E731
        self.outcomes.append(flat(here))
        self.margins.append(flat(margin))
        self.beyond.append(flat(beyond))
        return (jnp.broadcast_to(here, shape).astype(float) if given is None else given), jumps

    def holds(
        self, a: Value, b: Value, strict: bool = True, bends: bool = False
    ) -> tuple[Any, int]:
        """Whether a < b in the branch, or a <= b, as 0 or 1."""

        def at(given):
            here = (a.array < b.array if strict else a.array <= b.array).astype(float)
            held = here if given is None else given
            return here, (2.0 * held - 1.0) * (b.array - a.array), 1.0 - held

        return self.condition("compare", [a, b], at, bends=bends)

    def _table(self, knots: Value, x: Value) -> Value:
        places, n = jnp.asarray(knots.array), np.shape(knots.array)[0]

        def at(given):
            here = jnp.searchsorted(places, x.array)
            held = here if given is None else given.astype(int)
            below = jnp.where(held > 0, places[jnp.clip(held - 1, 0, n - 1)], -jnp.inf)
            above = jnp.where(held < n, places[jnp.clip(held, 0, n - 1)], jnp.inf)
            low, high = x.array - below, above - x.array
            step = jnp.where(low < high, -1, 1)
            return here.astype(float), jnp.minimum(low, high), (held + step).astype(float)

        found, on = self.condition("table", [x], at)
        kind = jnp.searchsorted(jnp.zeros(1), 0.0).dtype
        return Value(None if found is None else found.astype(kind), on)

    def _choose(self, branches, args: list[Value]) -> list[Value]:
        """All branches of a choice, so that the conditions within each are read."""
        which, rest = args[0], args[1:]
        every = [self.program(branch, rest) for branch in branches]
        if which.array is None:
            return [Value(None, which.on | x.on, math.inf) for x in every[0]]
        found = []
        for cases in zip(*every, strict=True):
            on = functools.reduce(lambda a, b: a | b.on, cases, which.on)
            if any(x.array is None for x in cases):
                found.append(Value(None, on, math.inf))
                continue
            pick = jnp.clip(jnp.asarray(which.array).astype(int), 0, len(cases) - 1)
            arrays = [jnp.asarray(x.array) for x in cases]
            value = arrays[0]
            for i, other in enumerate(arrays[1:], 1):
                value = jnp.where(pick == i, other, value)
            found.append(Value(value, on, math.inf if on & BY_TIME else 0.0))
        return found

    def _unroll(self, eqn, known: Loop, args: list[Value]) -> list[Value]:
        """A loop of known length, round by round."""
        body, length, n, m = known.body, known.length, known.consts, known.carry
        consts, carry, rows = args[:n], args[n : n + m], args[n + m :]
        if not length:
            nothing = (jnp.zeros(var.aval.shape, var.aval.dtype) for var in eqn.outvars[m:])
            return [*carry, *(Value(x) for x in nothing)]
        collected: list[list[Value]] = []
        for i in range(length):
            at = length - 1 - i if known.reverse else i
            row = [x if x.array is None else x._replace(array=x.array[at]) for x in rows]
            found = self.program(body, [*consts, *carry, *row])
            carry = found[:m]
            collected.append(found[m:])
        if known.reverse:
            collected.reverse()
        outs = []
        for column, var in zip(zip(*collected, strict=True), eqn.outvars[m:], strict=True):
            on = functools.reduce(lambda a, b: a | b.on, column, 0)
            missing = any(x.array is None for x in column)
            shape = var.aval.shape
            array = None if missing else jnp.stack([jnp.asarray(x.array) for x in column])
            assert array is None or array.shape == shape
            outs.append(Value(array, on, math.inf if on & BY_TIME else 0.0))
        return [*carry, *outs]


#: Degree up to which a polynomial of time and of sines of it hides nothing from a step.
_TRIVIAL_DEGREE = 3.0
_WAVES = frozenset({"sin", "cos"})
#: Functions that are flat, to all digits, for most arguments.
_BRIEF = frozenset({"exp", "exp2", "tanh", "logistic", "erf", "erfc"})
#: Functions that are not defined for all numbers.
_PARTIAL = frozenset({"pow", "sqrt", "rsqrt", "log", "log1p", "asin", "acos", "acosh", "atanh"})
#: Operations whose operands are evaluated one by one, to detect a small pulse beside a large drive.
_TERM_BY_TERM = frozenset(
    {"add", "sub", "neg", "add_any", "stack", "concatenate", "broadcast_in_dim", "reshape"}
) | {"squeeze", "convert_element_type", "copy", "slice", "reduce_sum"}
#: Likewise operations in which only one operand varies, such as a force divided by a mass.
_SCALES = frozenset({"mul", "div", "dot_general"})


def _degree(name: str, params, args: list[Value]) -> float:
    """Degree in time of a result, if it is a polynomial of time and of sines of it."""
    degrees = [x.degree for x in args]
    if name in _TERM_BY_TERM or name in ("transpose", "rev", "pad", "select_n"):
        return max(degrees)
    if name in ("mul", "dot_general"):
        return sum(degrees)
    if name == "div" and degrees[1] == 0:
        return degrees[0]
    if name == "integer_pow" and params["y"] > 0:
        return degrees[0] * params["y"]
    if name == "square":
        return degrees[0] * 2
    if name in _WAVES and degrees[0] <= 1:
        return 1.0  # it varies everywhere: its samples show a method how long a step may be
    return math.inf


@functools.lru_cache(maxsize=1024)
def _switches(jaxpr) -> bool:
    for eqn in jaxpr.eqns:
        if eqn.primitive.name in _RULES and _is_condition(eqn):
            return True
        if _is_unread(eqn):
            return True
        for value in eqn.params.values():
            for inner in value if isinstance(value, tuple | list) else (value,):
                inner = getattr(inner, "jaxpr", inner)
                if hasattr(inner, "eqns") and _switches(inner):
                    return True
    return False


def _is_zero(x: Value) -> bool:
    known = not x.on and not isinstance(x.array, jax.core.Tracer | jax.Array)
    return known and not np.any(x.array)


def _is_condition(eqn) -> bool:
    """Whether an operation that may be a condition is one for its types of numbers."""
    of = eqn.invars[1 if eqn.primitive.name == "clamp" else 0].aval.dtype
    if eqn.primitive.name == "sort" and not _is_readable(eqn):
        return False
    if eqn.primitive.name == "convert_element_type":
        wanted = eqn.params["new_dtype"]
        return jnp.issubdtype(of, jnp.floating) and jnp.issubdtype(wanted, jnp.integer)
    return jnp.issubdtype(of, jnp.floating)


def _is_callback(eqn) -> bool:
    return "callback" in eqn.primitive.name


def _is_unread(eqn) -> bool:
    """Whether an operation may be a condition that cannot be read."""
    if _is_callback(eqn):
        return True
    floats = bool(eqn.invars) and jnp.issubdtype(eqn.invars[0].aval.dtype, jnp.floating)
    return floats and eqn.primitive.name in _UNREAD


def _is_readable(eqn) -> bool:
    """Whether a sort is of few enough numbers, in one row."""
    shape = eqn.invars[0].aval.shape
    return len(shape) == 1 and shape[0] <= _LONGEST_ROW and eqn.params["num_keys"] == 1


def _may_switch(*programs) -> bool:
    """Whether programs contain operations that may be conditions."""
    return any(_switches(getattr(p, "jaxpr", p)) for p in programs)


def _compare(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    name = eqn.primitive.name
    a, b = args if name[0] == "l" else args[::-1]
    found, on = evaluation.holds(a, b, strict=name[:2] in ("lt", "gt"))
    evaluation.compare(a, b)
    return Value(None if found is None else found > 0.5, on)


def _select(which, no: Value, yes: Value, on: int, evaluation: BranchEvaluation) -> Value:
    """One of two values by an outcome of 0 or 1."""
    on = on | no.on | yes.on
    if which is None or no.array is None or yes.array is None:
        for x in (no, yes):
            evaluation._meets_state(x)
        return Value(None, on, math.inf)
    array = jnp.where(which > 0.5, yes.array, no.array)
    value = Value(array, on, max(no.degree, yes.degree))
    if evaluation.time_only and on & BY_TIME:
        evaluation._made[id(array)] = ("select", [no, yes])
        evaluation._kept.append(value)
    return value


def _sign(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    (x,) = args
    found, on = evaluation.holds(Value(jnp.zeros_like(x.array) if x.array is not None else None), x)
    return Value(None if found is None else 2.0 * found - 1.0, on)


def _abs(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    (x,) = args
    zero = Value(None if x.array is None else jnp.zeros_like(x.array), x.on)
    found, on = evaluation.holds(zero, x, bends=True)
    minus = x if x.array is None else x._replace(array=-x.array)
    return _select(found, minus, x, on, evaluation)


def _larger(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    a, b = args
    found, on = evaluation.holds(a, b, bends=True)
    ends = (a, b) if eqn.primitive.name == "max" else (b, a)
    larger = _select(found, *ends, on, evaluation)
    evaluation.take(found, *ends, larger)
    return larger


def _is_same(a: Value, b: Value) -> bool:
    """Whether two values are one value of a program, or equal known numbers."""
    if a.array is b.array:
        return True
    if a.on or b.on or any(isinstance(x.array, jax.core.Tracer) for x in (a, b)):
        return False
    return np.array_equal(np.asarray(a.array), np.asarray(b.array))


def _clamp(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    low, x, high = args
    below, on = evaluation.holds(x, low, bends=True)
    x = _select(below, x, low, on, evaluation)
    above, on = evaluation.holds(high, x, bends=True)
    return _select(above, x, high, on, evaluation)


def _whole(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    """The rule of ``floor``, ``ceil``, ``round`` and conversions to integers."""
    (x,), name = args, eqn.primitive.name
    rounds = {"floor": jnp.floor, "ceil": jnp.ceil, "round": jnp.round}
    rounded = rounds.get(name, jnp.trunc)

    def at(given):
        here = rounded(x.array)
        n = here if given is None else given
        low, high = _region(name, n)
        left, right = x.array - low, high - x.array
        return here, jnp.minimum(left, right), n + jnp.where(left < right, -1.0, 1.0)

    found, on = evaluation.condition("whole", [x], at)
    if found is not None and name == "convert_element_type":
        found = found.astype(eqn.params["new_dtype"])
    return Value(found, on)


def _region(name: str, n: Array) -> tuple[Array, Array]:
    """The numbers that are rounded to n."""
    if name == "floor":
        return n, n + 1.0
    if name == "ceil":
        return n - 1.0, n
    if name == "round":
        return n - 0.5, n + 0.5
    return jnp.where(n > 0, n, n - 1.0), jnp.where(n < 0, n, n + 1.0)


def _remainder(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    """x - n d, where n is the whole part of x / d."""
    x, d = args

    def at(given):
        here = jnp.trunc(x.array / d.array)
        n = here if given is None else given
        low, high = _region("trunc", n)
        left, right = x.array / d.array - low, high - x.array / d.array
        return here, jnp.minimum(left, right), n + jnp.where(left < right, -1.0, 1.0)

    found, on = evaluation.condition("whole", [x, d], at)
    on = on | x.on | d.on
    if found is None:
        return Value(None, on, math.inf)
    return Value(x.array - found * d.array, on, x.degree if not d.on else math.inf)


def _extreme(evaluation: BranchEvaluation, eqn, args: list[Value]) -> Value:
    """The largest or smallest of the numbers along some axes, or its place."""
    (x,), name = args, eqn.primitive.name
    axes, shape = tuple(eqn.params["axes"]), eqn.outvars[0].aval.shape
    last = tuple(range(-len(axes), 0))
    rows = None
    if x.array is not None:
        n = math.prod(np.shape(x.array)[a] for a in axes)
        rows = jnp.moveaxis(jnp.asarray(x.array), axes, last).reshape(*shape, n)

    def at(given):
        assert rows is not None  # what has no value has no outcome
        signed = rows if name.endswith("max") else -rows
        here = jnp.argmax(signed, -1)
        held = here if given is None else given.astype(int)
        own = jax.nn.one_hot(held, n, dtype=bool)
        others = jnp.where(own, -jnp.inf, signed)
        margin = _entry(signed, held) - jnp.max(others, -1)
        return here.astype(float), margin, jnp.argmax(others, -1).astype(float)

    found, on = evaluation.condition("extreme", [x], at, shape)
    if found is None:
        return Value(None, on | x.on, math.inf)
    if name.startswith("arg"):
        return Value(found.astype(eqn.outvars[0].aval.dtype), on)
    return Value(_entry(rows, found.astype(int)), on | x.on, x.degree)


def _entry(rows: Array, which: Array) -> Array:
    return jnp.take_along_axis(rows, which[..., None], -1)[..., 0]


def _sort(evaluation: BranchEvaluation, eqn, args: list[Value]) -> list[Value]:
    """Numbers in ascending order, and others with them, from the outcomes of all pairs."""
    keys, n = args[0], eqn.invars[0].aval.shape[0]
    i, j = np.triu_indices(n, 1)
    pair = [
        x if x.array is None else x._replace(array=x.array[k]) for x, k in ((keys, i), (keys, j))
    ]
    found, on = evaluation.holds(pair[1], pair[0], bends=len(args) == 1)
    on = functools.reduce(lambda a, b: a | b.on, args, on)
    if found is None or any(x.array is None for x in args):
        return [Value(None, on, math.inf) for _ in args]
    place = jnp.zeros(n).at[i].add(found).at[j].add(1.0 - found)
    there = place[None] == jnp.arange(n, dtype=place.dtype)[:, None]
    return [
        x._replace(array=jnp.sum(jnp.where(there, jnp.asarray(x.array)[None], 0), 1), on=on)
        for x in args
    ]


_RULES: dict[str, Callable[[BranchEvaluation, Any, list[Value]], Value | list[Value]]] = {
    **dict.fromkeys(_COMPARISONS, _compare),
    **{"sign": _sign, "abs": _abs, "max": _larger, "min": _larger, "clamp": _clamp},
    **dict.fromkeys(("floor", "ceil", "round", "convert_element_type"), _whole),
    "rem": _remainder,
    **dict.fromkeys(("reduce_max", "reduce_min", "argmax", "argmin"), _extreme),
    "sort": _sort,
}
