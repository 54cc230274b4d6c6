"""Motions of rates with conditions: piece by piece, each in one branch.

Steps end where a condition of the rate changes (`jaxdyn.plan`): at times found ahead from bounds
where it depends on time alone, at events of the motion where it depends on the state. Each piece is
integrated as if the other branches did not exist, so methods keep their order. A motion slides on a
surface that pushes it back from both sides. Tangents pass a switch by the saltation matrix.
"""

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.integrate import resting
from jaxdyn.integrate.event_search.crossings import Crossing, Sides, first_crossing
from jaxdyn.integrate.event_search.event_values import count, evaluate
from jaxdyn.integrate.march import History, Limits, SolveResult, look_from_start, march
from jaxdyn.plan import Plan, plan_of
from jaxdyn.plan.branch import Branch, InBranch, in_branch, jump
from jaxdyn.plan.plan import without_wrappers
from jaxdyn.plan.times import next_change
from jaxdyn.solvers import Method
from jaxdyn.solvers.stepper import state_of
from jaxdyn.status import Status

#: Roundings of state and time by which the margin of a condition at a switch may miss zero.
_MARGIN_ROUNDINGS = 64
#: Number of pieces in a row, each shorter than this part of the span, that count as chattering.
_MOST_STALLED, _NO_PROGRESS = 200, 1e-11
#: Largest depth of conditions within conditions whose outcomes are found anew after a switch.
_DEEPEST = 3
#: Largest sine of the angle between the normals of two conditions that change on one surface.
_PARALLEL = 1e-6
#: Largest number of surfaces that are crossed one by one, and the part of a tangent by which the
#: results of two orders of crossing may differ.
_MOST_CROSSED, _SAME = 32, 1e-6
#: The time of a switch is known to this number of relative tolerances of a step times the span,
#: with tolerances up to the second number. A switch closer than that to the start or the end
#: happens there.
_TIMES_KNOWN, _COARSEST_KNOWN = 16, 1e-10
#: Part of the rate by which the sum of the jumps at several surfaces may miss that across them all.
_MISFIT = 1e-9


class Arrival(NamedTuple):
    """The last piece of a motion with a length other than zero.

    Attributes:
      since: () the time at which it began.
      branch: its branch.
      ended: () number of the margin that ended it, if an event rested during it and was left at its
        end; else -1. See `InBranch.change`.
    """

    since: Array
    branch: Branch
    ended: Array


class Branches(NamedTuple):
    """The branches of a motion at the times at which its rate may be asked for.

    A motion that begins or ends on a surface at which the rate jumps has the tangents of one that
    begins and ends just behind it. So several motions, each of which begins where another ends,
    have the tangents of the whole, also where the last ends at the start of the first.

    Attributes:
      last: the one at the end: on a surface the one behind it, or before it if that is asked for.
      sampled: (s, ...) those at the samples; None if they are not asked for.
    """

    last: Branch
    sampled: Branch | None


def has_pieces(field: Any, k: int, limits: Limits) -> bool:
    """Whether motions of a state (k,) are integrated piece by piece."""
    if isinstance(without_wrappers(field), InBranch):  # a piece, which has no conditions
        return False
    return bool(plan_of(field, k).size or len(limits.breaks))


def first_event(
    field: Any, events: tuple, y0, t0, t1, limits: Limits, sides: Sides, *, method: Method
) -> tuple[SolveResult, Crossing, Arrival | None]:
    """The motion to where the search ended, and the first of some events; without derivatives.

    It calls `run_pieces` where the rate has conditions, or `breaks` are given.

    Args:
      field: see `flow`.
      events: see `run_pieces`.
      y0: (k,) start.
      t0: () start time.
      t1: () end time, before or after t0.
      limits: see `flow`.
      sides: see `first_crossing`.
      method: an adaptive one.
    Returns:
      The result, the event, and how the motion arrived there; None where there are no pieces.
    """
    no_times = jnp.zeros(0)
    if has_pieces(field, len(y0), limits):
        return run_pieces(field, events, y0, t0, t1, no_times, limits, sides, method=method)[:3]
    found = first_crossing(field, events, y0, t0, t1, limits, no_times, sides, method=method)
    return found[0], found[1], None


class Margins(eqx.Module):
    """The conditions of a rate as events: each happens where the motion leaves its branch.

    Attributes:
      field: the field in the branch.
      beyond: (e + 2 w,) by how much rounding puts each beyond zero where the piece begins.
      plan: the plan of the field's rate.
    """

    field: InBranch
    beyond: Array
    plan: Plan = eqx.field(static=True)

    @classmethod
    def of(cls, field: InBranch, plan: Plan, t: Array, y: Array) -> "Margins":
        """The margins of a piece that begins within its branch, whatever rounding says."""
        return cls(field, jnp.maximum(0.0, -field.margins(t, y)), plan)

    @property
    def count(self) -> int:
        """Number of functions: the conditions, and 2 for each surface of sliding."""
        return self.plan.size + 2 * self.plan.most_surfaces

    @property
    def direction(self) -> int:
        """Margins fall through zero."""
        return -1

    def value(self, t: Array, y: Array) -> Array:
        """(e + 2 w,) see `InBranch.margins`."""
        return self.field.margins(t, y) + self.beyond


class _Run(NamedTuple):
    """A motion between two pieces.

    Attributes:
      t: () the time that it has reached.
      y: (k, ...) the state there.
      branch: the branch of the next piece.
      crossed: (e,) conditions that have just changed.
      left: () number of the margin that has just ended the sliding on a surface, see
        `InBranch.margins`; else -1.
      known: (e,) conditions whose outcomes are known although the state is on their surface.
      old: the branch of the last piece.
      result: the result of all pieces so far.
      event: () index of the event that ended it, -1 for none.
      towards: () sign of the value of that event afterwards.
      begun: () whether there has been a piece.
      sides: (E,) signs of the values of the events at t, or before where they are within rounding
        of zero; 0 where they are not known.
      before: what the motion has shown so far.
      stalled: () number of pieces in a row, up to now, in which time has hardly advanced.
      kinked: (...) for each tangent, whether it does not exist, see `_Pieces._across`.
      arrival: how it has come to t.
      passed: () whether it has passed a switch at its end.
      sampled: (s, ...) its branches at the samples so far; None if they are not asked for.
      rested: (E,) whether the values of the events rested in the last piece, see `resting`.
    """

    t: Array
    y: Array
    branch: Branch
    crossed: Array
    left: Array
    known: Array
    old: Branch
    result: SolveResult
    event: Array
    towards: Array
    begun: Array
    sides: Array
    before: History
    stalled: Array
    kinked: Array
    arrival: Arrival
    passed: Array
    sampled: Branch | None
    rested: Array


def run_pieces(
    field: Any,
    events: tuple,
    y0,
    t0,
    t1,
    ts,
    limits: Limits,
    sides: Sides = (),
    *,
    method: Method,
    passes: bool | Array = True,
    sampled: bool = False,
) -> tuple[SolveResult, Crossing, Arrival, Branches]:
    """The motion of a field with conditions, and the first of some events; without derivatives.

    Args:
      field: see `flow`.
      events: modules with ``value(t, y)`` and ``direction``; of a plain state only.
      y0: (k, ...) start.
      t0: () start time.
      t1: () end time, before or after t0.
      ts: (s,) times between t0 and t1 in the order they are passed.
      limits: see `flow`.
      sides: the sides of the events, see `first_crossing`.
      method: an adaptive one.
      passes: whether tangents pass a switch at the end, see `Branches`.
      sampled: whether to return the branches at the times ts.
    """
    work = _Pieces.of(field, events, t0, t1, ts, limits, sides, len(y0), method, passes)
    run = jax.lax.while_loop(work.goes_on, work.piece, work.start(y0, sampled=sampled))
    right = run.result.status == Status.OK
    y1 = jnp.where(right & ~run.kinked[None], run.y, jnp.nan)
    happened = run.event >= 0
    crossing = Crossing(
        t=jnp.where(happened, run.t, work.direction * jnp.inf),
        y=state_of(run.y),
        event=jnp.maximum(run.event, 0),
        status=run.result.status,
        towards=run.towards,
        steps=run.result.steps + run.result.rejected,
        sizes=state_of(run.before.sizes),
        sides=run.sides,
        crossed=jnp.arange(len(run.sides)) == run.event,
    )
    result = eqx.tree_at(lambda result: result.y1, run.result, y1)
    last = run.arrival.branch
    last = jax.tree.map(lambda a, b: jnp.where(passes, a, b), run.branch, last)
    return result, crossing, run.arrival, Branches(last, run.sampled)


def first_branch(field: Any, y0, t0, t1, limits: Limits, *, method: Method) -> Branch | None:
    """The branch in which a motion begins; None if it has no pieces. Without derivatives.

    On a surface it is that of the motion which follows: a block at rest is held, or begins to slip.

    Args:
      field: see `flow`.
      y0: (k, ...) start.
      t0: () start time.
      t1: () end time, before or after t0.
      limits: see `flow`.
      method: a method, which need not be adaptive.
    """
    if not (method.adaptive and has_pieces(field, len(y0), limits)):
        return None
    given = jax.lax.stop_gradient(eqx.filter((field, y0, t0, t1), eqx.is_array))
    field, y0, t0, t1 = eqx.combine(given, (field, y0, t0, t1))
    work = _Pieces.of(field, (), t0, t1, jnp.zeros(0), limits, (), len(y0), method, True)
    return work.behind(work.begin(y0)[0])


class _Pieces(NamedTuple):
    """What all pieces of a motion share; see `run_pieces`."""

    plan: Plan
    field: Any
    system: Any
    events: tuple
    t0: Array
    t1: Array
    ts: Array
    limits: Limits
    sides: Sides
    direction: Array
    method: Method
    passes: bool | Array

    @classmethod
    def of(cls, field, events, t0, t1, ts, limits, sides, k: int, method, passes) -> "_Pieces":
        """The same for a state of k entries."""
        system = without_wrappers(field)
        direction = jnp.where(t1 >= t0, 1.0, -1.0)
        plan = plan_of(system, k)
        shared = t0, t1, ts, limits, sides, direction, method, passes
        return cls(plan, field, system, events, *shared)

    def begin(self, y0: Array) -> tuple[_Run, Array]:
        """The motion before its first piece, and whether () its branch is ambiguous.

        It has no history, and no branches at samples.
        """
        zero, none = jnp.zeros((), int), jnp.zeros(self.plan.size, bool)
        rate, first = self.plan.evaluate(self.system, self.t0, state_of(y0))
        given = jnp.concatenate([y0.ravel(), rate, jnp.stack([self.t0, self.t1])])
        fine = jnp.isfinite(given).all()
        nothing = SolveResult(
            y1=y0,
            ys=jnp.where((self.ts == self.t0).reshape(-1, *[1] * y0.ndim), y0[None], jnp.nan),
            steps=zero,
            rejected=zero,
            status=jnp.where(fine, int(Status.OK), int(Status.NOT_FINITE)),
            stiff=jnp.zeros((), bool),
        )
        branch = Branch.of(first.outcomes, self.plan.most_surfaces)
        sides = jnp.concatenate([jnp.zeros(0), *self._given_sides()])
        run = _Run(
            t=jnp.asarray(self.t0),
            y=y0,
            branch=branch,
            crossed=none,
            left=jnp.asarray(-1),
            known=none,
            old=branch,
            result=nothing,
            event=jnp.asarray(-1),
            towards=jnp.zeros(()),
            begun=jnp.zeros((), bool),
            sides=sides,
            before=History(jnp.zeros_like(y0), jnp.zeros(())),
            stalled=zero,
            kinked=jnp.zeros(y0.shape[1:], bool),
            arrival=Arrival(jnp.asarray(self.t0), branch, jnp.asarray(-1)),
            passed=jnp.zeros((), bool),
            sampled=None,
            rested=jnp.zeros(sides.shape, bool),
        )
        branch, ambiguous = self._settle(run)
        arrival = run.arrival._replace(branch=branch)
        return run._replace(branch=branch, arrival=arrival), ambiguous

    def behind(self, run: _Run) -> Branch:
        """The first branch of a motion, or that behind a surface if it starts just before one.

        This is the one for tangents, see `_after_switch`.
        """
        if not self.plan.on_state:
            return run.branch
        x = state_of(run.y)
        following, crossed, known = self._switch(run.branch, run.t, x, jnp.asarray(-1), True)
        beyond = run._replace(
            branch=following, old=run.branch, crossed=crossed, known=known, begun=crossed.any()
        )
        branch, ambiguous = self._settle(beyond)
        passes = crossed.any() & ~ambiguous
        return jax.tree.map(lambda a, b: jnp.where(passes, a, b), branch, run.branch)

    def start(self, y0: Array, *, sampled: bool) -> _Run:
        """The motion before its first piece."""
        run, ambiguous = self.begin(y0)
        # The first piece may be too short to show how large the motion becomes. On a surface where
        # a force jumps, the rate in one branch does not, so the jump is not taken for rounding.
        here, tolerance = in_branch(self.field, run.branch), self.limits.tolerance
        known, _ = look_from_start(here, self.t0, y0, self.t1, tolerance, self.method)
        run = run._replace(before=History(known.sizes, jnp.zeros(())))
        if sampled:
            rows = [jnp.broadcast_to(x, (len(self.ts), *x.shape)) for x in run.branch]
            run = run._replace(sampled=Branch(*rows))
        return _end_if_ambiguous(run, ambiguous)

    def goes_on(self, run: _Run) -> Array:
        """Whether another piece follows."""
        unfinished = self.direction * run.t < self.direction * self.t1
        unfinished = unfinished | self._is_before_switch(run)
        return unfinished & (run.event < 0) & (run.result.status == Status.OK)

    def _is_before_switch(self, run: _Run) -> Array:
        """Whether () tangents at the end still have to pass a switch, in a piece of length zero."""
        if not hasattr(self.field, "jump"):
            return jnp.zeros((), bool)
        in_time = jnp.asarray(self.plan.of_time) & (run.branch.outcomes != run.old.outcomes)
        switches = run.crossed.any() | in_time.any() | (run.left >= 0)
        return self.passes & run.begun & ~run.passed & switches

    @property
    def _known(self) -> Array:
        """() the accuracy to which the time of a switch is known."""
        eps = jnp.finfo(float).eps
        step = jnp.clip(self.limits.tolerance[0], eps, _COARSEST_KNOWN)
        span, last = jnp.abs(self.t1 - self.t0), jnp.maximum(jnp.abs(self.t0), jnp.abs(self.t1))
        return _TIMES_KNOWN * step * span + _MARGIN_ROUNDINGS * eps * last

    def piece(self, run: _Run) -> _Run:
        """The motion one piece further."""
        branch, now = run.branch, self.t1
        y, kinked = self._after_switch(run)
        if self.plan.of_time.any():
            now = next_change(self.plan, self.system, run.t, self.t1, branch.outcomes)
        now = self._before_break(run.t, now)
        # Under `vmap` motions that are over wait for the others: they must not be integrated again
        # in each round, a failed one up to the limit of steps.
        now = jnp.where(self.goes_on(run), now, run.t)
        used = run.result.steps + run.result.rejected
        limits = self.limits.with_steps(self.limits.max_steps[0] - used)
        piece = self._move(branch, run, y, now, limits)
        found, end, y_end, index, towards, sizes, sides, rests = piece
        ts = self.direction * self.ts
        within = (ts > self.direction * run.t) & (ts <= self.direction * end)
        rows = within.reshape(-1, *[1] * y.ndim)
        step = jnp.abs(end - run.t) / jnp.maximum(found.steps, 1)
        slow = jnp.abs(end - run.t) <= _NO_PROGRESS * jnp.abs(self.t1 - self.t0)
        stalled = jnp.where(slow, run.stalled + 1, 0)
        chatters = (found.status == Status.OK) & (stalled >= _MOST_STALLED)
        result = SolveResult(
            y1=run.result.y1,
            ys=jnp.where(rows, jnp.where(kinked[None, None], jnp.nan, found.ys), run.result.ys),
            steps=run.result.steps + found.steps,
            rejected=run.result.rejected + found.rejected,
            status=jnp.where(chatters, int(Status.CHATTERING), found.status),
            stiff=run.result.stiff | found.stiff,
        )
        event = jnp.where(index < len(self.events), index, -1)
        margin = index - len(self.events)
        over = self.direction * end >= self.direction * self.t1
        following, crossed, known = self._switch(branch, end, state_of(y_end), margin, over)
        reached = _Run(
            t=end,
            y=y_end,
            branch=following,
            crossed=crossed,
            left=jnp.where(margin >= self.plan.size, margin, -1),
            known=known,
            old=branch,
            result=result,
            event=jnp.where(found.status == Status.OK, event, -1),
            towards=towards,
            begun=jnp.ones((), bool),
            sides=sides,
            before=History(sizes, jnp.maximum(run.before.step, step)),
            stalled=stalled,
            kinked=kinked,
            arrival=self._arrival(run, end, over),
            passed=self.direction * run.t >= self.direction * self.t1,
            sampled=_in_rows(within, branch, run.sampled),
            rested=rests,
        )
        return self._settled(reached, over)

    def _arrival(self, run: _Run, end: Array, over: Array) -> Arrival:
        """How the motion arrives at the end of a piece."""
        # What is left after a switch at the very end is not the piece by which the motion arrives.
        rest = ~jnp.asarray(self.passes) & run.crossed.any() & over
        rest = (end == run.t) | (rest & (jnp.abs(end - run.t) <= self._known))
        new = Arrival(run.t, run.branch, jnp.asarray(-1))
        return jax.tree.map(lambda new, old: jnp.where(rest, old, new), new, run.arrival)

    def _settled(self, reached: _Run, over: Array) -> _Run:
        """The motion after a piece with the branch of the next one; `over` if there is none."""
        # The branch is kept from piece to piece, never found twice: XLA computes a sine anew for
        # each of its uses, in several ways, and at a switch two of them may have different signs.
        branch, ambiguous = self._settle(reached)
        # Where the motion is over, the branch that would follow is not needed, or is known already.
        stays = (ambiguous & over) | reached.passed
        reached = reached._replace(
            branch=jax.tree.map(lambda old, new: jnp.where(stays, old, new), reached.old, branch),
            crossed=reached.crossed & ~stays,
            left=jnp.where(stays, -1, reached.left),
        )
        if self.events and self.plan.most_surfaces:
            reached = self._leaving(reached)
        return _end_if_ambiguous(reached, ambiguous & self.goes_on(reached))

    def _leaving(self, run: _Run) -> _Run:
        """The motion, ended if it leaves an event on which it has rested."""
        t, y, field = run.t, state_of(run.y), InBranch(self.system, run.branch)
        leaves, sides = resting.leaves(self.events, field, run.old, self.plan, t, y)
        leaves &= run.rested & (sides != 0) & self.goes_on(run)
        happens = leaves & (sides * run.sides < 0) & resting.wanted(self.events, sides)
        first = jnp.argmax(happens)
        ended = jnp.where(happens.any(), self._switched(run)[0], run.arrival.ended)
        return run._replace(
            event=jnp.where(happens.any(), first, run.event),
            towards=jnp.where(happens.any(), sides[first], run.towards),
            sides=jnp.where(leaves, sides, run.sides),
            arrival=run.arrival._replace(ended=ended),
        )

    def _before_break(self, t: Array, now: Array) -> Array:
        """The time `now`, or the first after t at which a step ends by request."""
        if not len(self.limits.breaks):
            return now
        after = self.direction * jnp.asarray(self.limits.breaks)
        first = jnp.min(jnp.where(after > self.direction * t, after, jnp.inf))
        return self.direction * jnp.minimum(first, self.direction * now)

    def _move(self, branch: Branch, run: _Run, y: Array, now: Array, limits: Limits):
        """A piece up to a time: result, end, state there, the event that ended it, its side.

        The last results are the sizes of the motion, the sides of the events at the end, and
        whether they rest. The sides are kept from piece to piece: an event may happen where a piece
        ends.
        """
        t, here = run.t, in_branch(self.field, branch)
        options = {"method": self.method, "before": run.before}
        if not (self.plan.on_state or self.events):
            found, _, sizes = march(here, y, t, now, self.ts, limits, **options)
            end = now, found.y1, jnp.asarray(-1), jnp.zeros(())
            return found, *end, sizes, run.sides, run.rested
        plain = InBranch(self.system, branch)
        events, rests = self.events, run.rested
        ends = np.cumsum([count(event) for event in events])[:-1]
        sides = tuple(jnp.split(run.sides, ends)) if events else ()
        on = self._begins_on(events, run)
        if events and self.plan.most_surfaces:
            size = state_of(run.before.sizes)
            rests = resting.rests(events, plain, self.plan, t, state_of(y), size)
            events = resting.held(events, rests, run.sides)
        if self.plan.on_state:
            margins = Margins.of(plain, self.plan, t, state_of(y))
            # A piece begins within its branch.
            events, sides = (*events, margins), (*sides, 1)
        seen, crossing = first_crossing(
            here if y.ndim == 1 else plain,
            events,
            state_of(y),
            t,
            now,
            limits,
            self.ts if y.ndim == 1 else self.ts[:0],
            sides,
            method=self.method.for_tangents,
            before=History(state_of(run.before.sizes), run.before.step),
            on=on,
            decides=(t == self.t0) & ~rests,
        )
        hit = (crossing.status == Status.OK) & jnp.isfinite(crossing.t)
        end = jnp.where(hit, crossing.t, now)
        x = jnp.where(hit, crossing.y, seen.y1)
        n = len(run.sides)
        index, sides, towards = crossing.event, crossing.sides[:n], crossing.towards
        sides = jnp.where(sides == 0, run.sides, sides)
        if self.events:
            index, at = resting.at_switch(here, self.events, crossing, n, run.sides)
            sides = jnp.where(rests, run.sides, jnp.where(hit, at, sides))
            towards = jnp.where(index == crossing.event, towards, crossing.sides[index])
        index = jnp.where(hit, index, -1)
        if y.ndim == 1:
            seen = eqx.tree_at(lambda seen: seen.status, seen, crossing.status)
            return seen, end, x, index, towards, crossing.sizes, sides, rests
        found, _, sizes = march(here, y, t, end, self.ts, limits, **options)
        status = jnp.where(crossing.status == Status.OK, found.status, crossing.status)
        found = eqx.tree_at(lambda found: found.status, found, status)
        flat = found.y1.reshape(len(y), -1)
        y = jnp.concatenate([x[:, None], flat[:, 1:]], 1).reshape(y.shape)
        return found, end, y, index, towards, sizes, run.sides, rests

    def _begins_on(self, events: tuple, run: _Run) -> Array | bool:
        """(E + margins,) whether a piece may begin on each event, with those of its conditions.

        It may not where a value is beyond zero by more than rounding just after a switch: the value
        has jumped there.
        """
        if not events:
            return True
        x, size = state_of(run.y), state_of(run.before.sizes)
        here = evaluate(self.field, events, run.t, x, size)
        noise = _MARGIN_ROUNDINGS * (here.rounding + jnp.abs(run.t) * here.speeds)
        margins = self.plan.size + 2 * self.plan.most_surfaces if self.plan.on_state else 0
        on = ~run.begun | ~(jnp.abs(here.values) > noise)
        return jnp.concatenate([on, jnp.ones(margins, bool)])

    def _given_sides(self) -> list[Array]:
        """The given signs of the values of each event just after the start."""
        pairs = zip(self.events, self.sides, strict=True)
        return [jnp.broadcast_to(jnp.asarray(side, float), count(event)) for event, side in pairs]

    def _switch(self, branch: Branch, t: Array, x: Array, index: Array, near: Array | bool):
        """The branch after a condition has changed, and which conditions are crossed and known.

        Args:
          branch: the branch before.
          t: () time.
          x: (k,) state.
          index: () number of the margin that has fallen to zero; negative for none.
          near: whether a condition that is about to change counts as changed, if none has.
        """
        e = self.plan.size
        if not self.plan.on_state:
            return branch, jnp.zeros(e, bool), jnp.zeros(e, bool)
        _, here = self.plan.evaluate(self.system, t, x, branch.outcomes)
        by_time, rows = self._slopes(t, x, branch.outcomes)
        rate = InBranch(self.system, branch).rate(t, x)
        along = by_time + jnp.sum(rows * rate[None], 1)
        noise = self._noise(t, x, by_time, rows)
        left = jnp.where(self.direction * along < 0, jnp.abs(here.margins / along), jnp.inf)
        left = jnp.where(jnp.asarray(self.plan.of_time) | branch.surface, jnp.inf, left)
        soon = near & (index < 0) & (jnp.min(left) <= self._known)
        index = jnp.where(soon, jnp.argmin(left), index)
        own = jnp.arange(e) == index
        # Conditions that change within rounding of one time change together.
        off = jnp.sum(jnp.where(own, jnp.abs(here.margins / along), 0.0))
        off = 2 * jnp.where(jnp.isfinite(off), off, 0.0)
        noise = noise + jnp.abs(along) * (
            off + _MARGIN_ROUNDINGS * jnp.finfo(x.dtype).eps * jnp.abs(t)
        )
        falls = (jnp.abs(here.margins) <= noise) & (self.direction * along < 0)
        together = falls & ~jnp.asarray(self.plan.of_time) & ~branch.surface
        changed = (index >= 0) & (index < e)
        crossed = jnp.where(changed, own | together, False)
        # Numbers after those of the conditions are weights behind the surfaces, then before them.
        row = (index - e) % max(self.plan.most_surfaces, 1)
        left = (index >= e) & (jnp.arange(self.plan.most_surfaces) == row)
        leaves = (branch.surfaces & left[:, None]).any(0)
        outcomes = jnp.where(crossed, here.beyond, branch.outcomes)
        back = leaves & (index < e + self.plan.most_surfaces)
        following = Branch(
            outcomes=jnp.where(back, branch.before, outcomes),
            before=jnp.where(crossed, branch.outcomes, branch.before),
            surfaces=branch.surfaces & ~left[:, None],
        )
        return following, crossed, crossed | branch.surface

    def _settle(self, run: _Run) -> tuple[Branch, Array]:
        """The branch of the next piece: outcomes at its start, and surfaces on which it slides.

        Returns:
          The branch, and whether () it is ambiguous.
        """
        t, x, of_time = run.t, state_of(run.y), jnp.asarray(self.plan.of_time)

        def settle(_, found):
            outcomes, near = found
            _, here = self.plan.evaluate(self.system, t, x, outcomes)
            if self.plan.on_state:
                by_time, rows = self._slopes(t, x, outcomes)
                near = (jnp.abs(here.margins) <= self._noise(t, x, by_time, rows)) & ~of_time
            return jnp.where(run.known | near, outcomes, here.outcomes), near

        rounds = _DEEPEST if self.plan.size > 1 else 1
        start = run.branch.outcomes, jnp.zeros(self.plan.size, bool)
        outcomes, near = jax.lax.fori_loop(0, rounds, settle, start)
        if not self.plan.most_surfaces:
            return run.branch._replace(outcomes=outcomes, before=outcomes), jnp.zeros((), bool)
        first = ~run.begun
        _, here = self.plan.evaluate(self.system, t, x, outcomes)
        undecided = run.crossed | run.branch.surface | (first & near)
        before = jnp.where(first, here.beyond, run.branch.before)
        return self._decide(t, x, outcomes, jnp.where(undecided, before, outcomes), undecided)

    def _decide(self, t: Array, x: Array, outcomes: Array, before: Array, undecided: Array):
        """The branch of a motion on some surfaces, and whether () it is ambiguous.

        At each surface the motion goes on, returns, or slides. The decisions are repeated on the
        side to which they lead; in the last round none may change.

        Args:
          t: () time.
          x: (k,) state.
          outcomes: (e,) outcomes behind the surfaces.
          before: (e,) outcomes before them.
          undecided: (e,) conditions that change on the surfaces.
        """
        own = self._surfaces(t, x, outcomes, undecided, self.plan.jumping)

        def decide(_, found):
            outcomes, before, *_ = found
            balance = InBranch(self.system, Branch(outcomes, before, own)).balance(t, x)
            weights = balance.settle(self.direction)
            returns = own & (weights >= 1)[:, None]
            surfaces = own & ((weights > 0) & (weights < 1))[:, None]
            back = returns.any(0)
            sides = jnp.where(back, before, outcomes), jnp.where(back, outcomes, before)
            several = jnp.sum(surfaces.any(1)) > 1
            mean = balance.mean(jnp.where(surfaces.any(1), 1.0, 0.0))
            size = jnp.max(jnp.abs(balance.rates), 0)
            return *sides, surfaces, back.any(), several, mean, size

        none, never = jnp.zeros(own.shape, bool), jnp.zeros((), bool)
        start = outcomes, before, none, never, never, jnp.zeros_like(x), jnp.zeros_like(x)
        rounds = 1 if len(own) == 1 else _DEEPEST
        outcomes, before, surfaces, changes, several, mean, size = jax.lax.fori_loop(
            0, rounds, decide, start
        )
        branch = Branch(outcomes, jnp.where(surfaces.any(0), before, outcomes), surfaces)
        if len(own) == 1:
            return branch, never
        # That each surface has a weight of its own requires that the jumps add up.
        rate = InBranch(self.system, branch).side(t, x, branch.before)[0]
        adds_up = jnp.all(jnp.abs(rate - mean) <= _MISFIT * size)
        return branch, changes | (several & ~adds_up)

    def _surfaces(
        self, t: Array, x: Array, outcomes: Array, undecided: Array, rows: np.ndarray
    ) -> Array:
        """(w, e) which conditions change on the same surface as each of w conditions.

        Args:
          t: () time.
          x: (k,) state, on all the surfaces.
          outcomes: (e,) outcomes there.
          undecided: (e,) conditions that change there.
          rows: (w,) numbers of these conditions; of several on one surface the row of the first has
            all of them, and the rows of the others are empty.
        """
        if self.plan.size < 2:
            return undecided[None] & (rows[:, None] == np.arange(self.plan.size))
        by_time, normals = self._slopes(t, x, outcomes)
        normals = jnp.concatenate([normals, by_time[:, None]], 1)
        alike = _are_parallel(jnp.where(undecided[:, None], normals, 0.0))
        own = undecided[None] & undecided[rows, None] & alike[rows]
        first = jnp.argmax(own[:, rows], 1) == np.arange(len(rows))
        return own & first[:, None]

    def _slopes(self, t: Array, x: Array, outcomes: Array) -> tuple[Array, Array]:
        """(e,) and (e, k) derivatives of margins with respect to time and state."""

        def margins(t, x):
            return self.plan.evaluate(self.system, t, x, outcomes)[1].margins

        return jax.jacfwd(margins, argnums=(0, 1))(t, x)

    @staticmethod
    def _noise(t: Array, x: Array, by_time: Array, rows: Array) -> Array:
        """(e,) the size up to which a margin may be only rounding."""
        size = jnp.sum(jnp.abs(rows * x[None]), 1) + jnp.abs(t * by_time)
        return _MARGIN_ROUNDINGS * jnp.finfo(x.dtype).eps * jnp.where(jnp.isfinite(size), size, 0.0)

    def _after_switch(self, run: _Run) -> tuple[Array, Array]:
        """The state with tangents or adjoints changed by saltation matrices, and `kinked`."""
        if not (hasattr(self.field, "jump") and self.plan.size):
            return run.y, run.kinked  # steps may end where nothing switches, by `Limits.breaks`
        branch = run.branch
        which, changed = self._switched(run)
        # The rate is continuous where sliding ends, but that of tangents is not.
        left = (run.left >= 0) & ((run.left < self.plan.size) | (run.y.ndim > 2))
        jumps = run.begun & (run.crossed.any() | changed.any() | left)
        # A switch just after the start counts as before it, and one just before the end as after it
        # if tangents do not pass it.
        early = (jnp.abs(run.t - self.t0) <= self._known) & ~branch.slides
        late = (jnp.abs(self.t1 - run.t) <= self._known) & ~jnp.asarray(self.passes)
        jumps = jumps & ~(run.crossed.any() & (early | late))
        # Motions that start beside one that slides from the start reach its surface at once.
        jumps = jumps | (~run.begun & branch.slides)
        if not self.plan.most_surfaces:
            after, kinked = jump(self.field, run.t, run.y, run.old, branch, which), run.kinked
        else:
            after, kinked = self._across(run, which)
            kinked = run.kinked | (jumps & kinked)
        return jnp.where(jumps, after, run.y), kinked

    def _switched(self, run: _Run) -> tuple[Array, Array]:
        """Number () of the margin that ended the last piece, and (e,) conditions on time."""
        changed = jnp.asarray(self.plan.of_time) & (run.branch.outcomes != run.old.outcomes)
        _, here = self.plan.evaluate(self.system, run.t, state_of(run.y), run.old.outcomes)
        nearest = jnp.argmin(jnp.where(changed, jnp.abs(here.margins), jnp.inf))
        which = jnp.where(run.crossed.any(), jnp.argmax(run.crossed), nearest)
        return jnp.where(run.left >= 0, run.left, which), changed

    def _across(self, run: _Run, which: Array) -> tuple[Array, Array]:
        """The state with tangents after crossing, one by one, all surfaces that it meets at once.

        Motions beside it cross them in another order, or start on the other side of those on which
        it starts. Whether a tangent depends on that, and so does not exist, is returned as well.

        Args:
          run: the motion.
          which: () the condition that changes if none is crossed.
        """
        old, new = run.old, run.branch
        every = np.flatnonzero(~self.plan.of_time)[:_MOST_CROSSED]
        met = jnp.where(run.begun, run.crossed, new.surface)
        own = self._surfaces(run.t, state_of(run.y), old.outcomes, met, every)
        count = jnp.sum(own.any(1))
        place = jnp.where(own.any(1), jnp.cumsum(own.any(1)) - 1, -1)

        def cross(i, found, reverse):
            y, here, done = found
            number = jnp.where(reverse, count - 1 - i, i)
            part = (own & (place == number)[:, None]).any(0)
            done = done | part | (i >= count - 1)
            there = jax.tree.map(lambda a, b: jnp.where(done, a, b), new, here)
            on = jnp.where(part.any(), jnp.argmax(part), which)
            return jump(self.field, run.t, y, here, there, on), there, done

        def in_order(reverse):
            side = jnp.where(reverse, new.before, new.outcomes)
            beside = Branch.of(side, self.plan.most_surfaces)
            first = jax.tree.map(lambda a, b: jnp.where(run.begun, a, b), old, beside)
            start = run.y, first, jnp.zeros(self.plan.size, bool)
            step = functools.partial(cross, reverse=reverse)
            return jax.lax.fori_loop(0, jnp.maximum(count, 1), step, start)[0]

        one, other = jax.lax.map(in_order, jnp.array([False, True]))
        return one, (jnp.abs(one - other) > _SAME * _tangent_sizes(run.y, one, other)).any(0)


def _in_rows(chosen: Array, branch: Branch, rows: Branch | None) -> Branch | None:
    """Branches (s, ...), if there are any, with `branch` put into the chosen (s,) rows."""

    def choose(new, old):
        return jnp.where(chosen.reshape(-1, *[1] * new.ndim), new[None], old)

    return None if rows is None else jax.tree.map(choose, branch, rows)


def _end_if_ambiguous(run: _Run, ambiguous: Array) -> _Run:
    """The motion, ended if () its branch is ambiguous."""
    status = jnp.where(
        ambiguous & (run.result.status == Status.OK), int(Status.CHATTERING), run.result.status
    )
    return eqx.tree_at(lambda run: run.result.status, run, status)


def _tangent_sizes(*of: Array) -> Array:
    """(k, ...) sizes of the entries of tangents (k, ...), for any units of rows and columns."""
    sizes = sum(jnp.abs(part) for part in of)
    flat = jnp.reshape(sizes, (len(sizes), -1))
    rows = jnp.max(flat, 1, keepdims=True)
    columns = jnp.max(flat / jnp.where(rows > 0, rows, 1.0), 0, keepdims=True)
    return jnp.reshape(rows * columns, sizes.shape)


def _are_parallel(rows: Array) -> Array:
    """(e, e) whether normals (e, m) of surfaces are parallel, in any units; a zero normal is."""
    most = jnp.max(jnp.abs(rows), axis=0)
    rows = rows / jnp.where(most > 0, most, 1.0)[None]
    products = jnp.sum(rows[:, None] * rows[None], axis=2)
    squares = jnp.diag(products)
    return products**2 >= (1.0 - _PARALLEL**2) * jnp.outer(squares, squares)
