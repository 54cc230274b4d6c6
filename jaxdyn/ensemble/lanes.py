"""Many motions on one core or device: lanes side by side, each with its own steps.

The rows of a queue, one motion each, pass through a group of `WIDTH` lanes. All lanes take one
step of the method together, which vectorises (lanes are the last axis everywhere), but each has
its own time, step and verdict of the step control, the one of `simulate`. As soon as a lane ends,
successfully or not, its result is written to its row and the next of the queue takes its place:
no lane waits for another.

All of it, including the change of lanes, is one loop without scatters, which XLA on CPU fuses
into one function. No operation mixes lanes and the group always has the same width, so the result
of a row does not depend on the rows around it.

On a GPU an operation on 32 lanes takes as long as one on thousands. There a group has as many lanes
as the queue has rows: all motions start together, and lanes that have ended wait for the slowest.
"""

import functools
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _labelled, _text
from jaxdyn._labelled import Labelled, Values, entries
from jaxdyn._text import second
from jaxdyn.integrate.march import (
    UNROLLED_BELOW,
    Limits,
    Lookahead,
    StepControl,
    Watch,
    clip,
    first_step,
    look_from_start,
    lookahead,
)
from jaxdyn.integrate.pieces import run_pieces
from jaxdyn.plan import plan_of
from jaxdyn.scene import Field, Scene
from jaxdyn.solvers import Method
from jaxdyn.solvers.formulas.formulas import simplify
from jaxdyn.solvers.method import operations
from jaxdyn.solvers.stepper import StepError, allowed_error, groups_of, grow, sizes_after_rejection
from jaxdyn.status import Status, tally

#: Number of lanes in a group on a core of a CPU. The compiler unrolls a loop over 16 or fewer
#: before vectorisation, which makes it slower by half; from 48 on the stages of a step exceed the
#: first-level cache.
WIDTH = 32


class Motions(NamedTuple):
    """The motions to integrate, one per row.

    Attributes:
      y0: (n, k) starts.
      t0: (n,) start times.
      t1: (n,) end times, each before or after its start.
      numbers: a tree like the field: (n, ...) where each motion has its own, None elsewhere.
    """

    y0: Array
    t0: Array
    t1: Array
    numbers: Any


class Ends(NamedTuple):
    """The results, one per motion.

    Attributes:
      y1: (n, k) states at the end; NaN unless the status is OK.
      t: (n,) times reached: the end, or before it where a watch, or the status, ended the motion.
      status: (n,) `Status` codes.
      steps: (n,) accepted steps.
      rejected: (n,) rejected steps.
      seen: what the watch remembers, each array with n as first axis.
    """

    y1: Array
    t: Array
    status: Annotated[Array, Status]
    steps: Array
    rejected: Array
    seen: Any

    __repr__ = _text.fields
    _repr_html_ = _text.html

    def to_pandas(self, scene: Scene) -> Any:
        """The ends as a pandas DataFrame: a row for each motion, a column for each entry.

        Args:
          scene: the scene of the motions, which names the entries and their units.
        Raises:
          ValueError: pandas is not installed.
        """
        return _labelled.frame(self._to_labelled(scene))

    def to_xarray(self, scene: Scene) -> Any:
        """The ends as an xarray Dataset along the axis "motion".

        Args:
          scene: the scene of the motions, which names the entries and their units.
        Raises:
          ValueError: xarray is not installed.
        """
        return _labelled.to_dataset(self._to_labelled(scene))

    def _to_labelled(self, scene: Scene) -> Labelled:
        labels, axes = scene.labels(), ("motion",)
        counts = {name: getattr(self, name) for name in ("status", "steps", "rejected")}
        return Labelled(
            {"t": Values(axes, np.asarray(self.t), second(labels) or "1")},
            {
                **entries(axes, self.y1, labels),
                **{name: Values(axes, np.asarray(x)) for name, x in counts.items()},
            },
        )

    @property
    def ok(self) -> Array:
        """(n,) whether each motion reached its end, or was stopped by a watch."""
        return self.status == Status.OK

    @property
    def message(self) -> str:
        """Number of motions with each status, and the remedies; host only."""
        return tally(self.status, "motion")


class _Lane(NamedTuple):
    """A motion in progress; in a group every array has the lanes as last axis."""

    row: Array  # () its row of the queue
    running: Array  # () whether it takes another step
    ended: Array  # () whether it has ended and is not written yet
    direction: Array  # () 1 or -1; the times below are negated where it is -1
    t: Array  # () time
    tnext: Array  # () end of the next step
    t1: Array  # () end
    y: Array  # (k,)
    carry: Array  # (k,) rounding error of y, for the compensated sum
    sizes: Array  # (k,) of the motion so far
    status: Array
    steps: Array
    rejected: Array
    numbers: Any
    control: Any  # what the step control remembers
    parts: Array | None  # sizes of the parts of the rate in time, see `Lookahead`


def integrate(
    shared: Field,
    motions: Motions,
    count: Array,
    limits: Limits,
    watch: Watch | None,
    *,
    method: Method,
    together: bool = False,
) -> Ends:
    """The ends of the first `count` motions; the other rows are undefined.

    Args:
      shared: the field, with None where each motion has its own numbers.
      motions: the queue of n rows.
      count: () number of valid rows.
      limits: tolerances of one step, and the maximum number of steps.
      watch: the observer of accepted steps of each motion, or None.
      method: the method.
      together: whether all motions start together, each in a lane of its own.
    """
    n = motions.y0.shape[0]
    first = jax.tree.map(lambda x: x[0], motions)
    if plan_of(eqx.combine(first.numbers, shared), len(first.y0)).size:
        # On a CPU one after the other: lanes would wait for each other where the rate switches.
        each = jax.vmap if together else lambda f: functools.partial(jax.lax.map, f)
        return _in_pieces(shared, motions, count, limits, watch, method=method, each=each)
    rate = eqx.combine(first.numbers, shared).rate
    loops = 2 if operations(rate, first.t0, first.y0) <= UNROLLED_BELOW else 1
    work = _LaneStepper(shared=shared, limits=limits, watch=watch, method=method.in_loops(loops))
    put = jax.lax.dynamic_update_index_in_dim

    def begin(row) -> _Lane:
        last = jnp.minimum(row, n - 1)  # a valid row for idle lanes
        motion = jax.tree.map(lambda x: jax.lax.dynamic_index_in_dim(x, last, 0, False), motions)
        lane = work.begin(row, motion)
        wanted = row < count
        return lane._replace(running=wanted & lane.running, ended=wanted & ~lane.running)

    if together:
        group = jax.vmap(begin, out_axes=-1)(jnp.arange(n))
        group = jax.lax.while_loop(lambda g: g.running.any(), lambda g: work.step(g), group)
        return jax.vmap(work.end, in_axes=-1)(group)

    def change(carry):
        """Write the result of one ended lane and start the next motion in it."""
        row, group, ends = carry
        j = jnp.argmax(group.ended)
        lane = jax.tree.map(lambda x: jax.lax.dynamic_index_in_dim(x, j, -1, False), group)
        ends = jax.tree.map(lambda x, new: put(x, new, lane.row, 0), ends, work.end(lane))
        group = jax.tree.map(lambda x, new: put(x, new, j, -1), group, begin(row))
        return row + 1, group, ends

    def body(carry):
        row, group, ends = jax.lax.while_loop(lambda c: c[1].ended.any(), change, carry)
        return row, work.step(group), ends

    # Lanes start empty, as if they had ended; their results go to a row after the last.
    lane = jax.eval_shape(begin, jnp.zeros((), int))
    group = jax.tree.map(lambda s: jnp.zeros((*s.shape, WIDTH), s.dtype), lane)
    group = group._replace(row=jnp.full(WIDTH, n), ended=jnp.ones(WIDTH, bool))
    ends = jax.eval_shape(work.end, lane)
    ends = jax.tree.map(lambda s: jnp.zeros((n + 1, *s.shape), s.dtype), ends)
    ends = jax.lax.while_loop(
        lambda c: (c[1].running | c[1].ended).any(), body, (jnp.zeros((), int), group, ends)
    )[2]
    return jax.tree.map(lambda x: x[:n], ends)


class _LaneStepper(eqx.Module):
    """How a motion begins, steps and ends."""

    shared: Field
    limits: Limits
    watch: Watch | None
    method: Method = eqx.field(static=True)

    def begin(self, row: Array, motion: Motions) -> _Lane:
        """A lane before its first step."""
        y, t0, t1, numbers = motion
        field = eqx.combine(numbers, self.shared)
        direction = jnp.where(t1 > t0, 1.0, -1.0)
        start, end = direction * t0, direction * t1
        known, look = look_from_start(field, t0, y, t1, self.limits.tolerance, self.method)
        ok = jnp.isfinite(jnp.concatenate([y, known.rate, jnp.stack([t0, t1])])).all()
        first = first_step(self.method, self.limits.tolerance, known, y)
        parts = None if look is None else look.sizes
        order = self.method.error_order
        control = self._control(direction, first, look)
        tnext, control = control.init(None, start, end, y, None, None, None, order)
        nothing = jnp.zeros((), int)
        return _Lane(
            row=row,
            running=ok & (start < end),
            ended=~(ok & (start < end)),
            direction=direction,
            t=start,
            tnext=clip(tnext, end),
            t1=end,
            y=y,
            carry=jnp.zeros_like(y),
            sizes=known.sizes,
            status=jnp.where(ok, int(Status.OK), int(Status.NOT_FINITE)),
            steps=nothing,
            rejected=nothing,
            numbers=numbers,
            control=control,
            parts=parts,
        )

    def step(self, group: _Lane) -> _Lane:
        """The group after one step of each lane that runs."""

        def rate(numbers, t, y):
            return simplify(eqx.combine(numbers, self.shared).rate)(t, y)

        def project(numbers, t, y):
            return eqx.combine(numbers, self.shared).project(t, y)

        def loses(numbers, *ends):
            return eqx.combine(numbers, self.shared).loses(*ends)

        def every(fn, *ends):
            return jax.vmap(fn, in_axes=-1, out_axes=-1)(group.numbers, *ends)

        start, end = group.direction * group.t, group.direction * group.tnext
        found = self.method.advance(
            jax.jit(lambda t, y: every(rate, t[0], y)),
            start[None],
            (end - start)[None],
            group.y,
        )
        y, carry = found.onto(group.y, group.carry)
        y = every(project, end, y)
        lost = every(loses, start, group.y, end, y)
        y = y if lost is None else jnp.where(lost, jnp.nan, y)
        return jax.vmap(self._judge, in_axes=-1, out_axes=-1)(group, y, carry, found.error)

    def _judge(self, lane: _Lane, y: Array, carry: Array, error: Array) -> _Lane:
        """The lane after a step to y, if the step control accepts it."""
        field = eqx.combine(lane.numbers, self.shared)
        sizes = grow(groups_of(field, y), lane.sizes, y)
        may = allowed_error(self.limits.tolerance, sizes, lane.y, y)
        look = None
        if lane.parts is not None:
            look = lookahead(field, len(y), lane.t, lane.t1, lane.parts)
        control = self._control(lane.direction, lane.t1, look)
        keep, t, tnext, _, control, result = control.adapt_step_size(
            lane.t,
            lane.tnext,
            lane.y,
            y,
            None,
            StepError(error, may),
            self.method.error_order,
            lane.control,
        )
        steps = lane.steps + keep.astype(int)
        rejected = lane.rejected + (~keep).astype(int)
        there = (t >= lane.t1) | (result == diffrax.RESULTS.event_occurred)
        status = jnp.where(
            result == diffrax.RESULTS.dt_min_reached,
            int(Status.STEP_COLLAPSED),
            jnp.where(
                there | (steps + rejected < self.limits.max_steps[0]),
                int(Status.OK),
                int(Status.STEP_LIMIT),
            ),
        )
        over = there | (status != Status.OK)
        new = lane._replace(
            running=~over,
            ended=over,
            t=t,
            tnext=clip(tnext, lane.t1),
            y=jnp.where(keep, y, lane.y),
            carry=jnp.where(keep, carry, lane.carry),
            sizes=jnp.where(keep, sizes, sizes_after_rejection(lane.sizes, sizes)),
            status=status,
            steps=steps,
            rejected=rejected,
            control=control,
        )
        # An idle lane stays unchanged: no NaN or infinity builds up in it.
        return jax.tree.map(functools.partial(jnp.where, lane.running), new, lane)

    def end(self, lane: _Lane) -> Ends:
        """The result of a lane that has ended."""
        y = jnp.where(lane.status == Status.OK, lane.y, jnp.nan)
        seen = lane.control.watch
        t = lane.direction * lane.t
        return Ends(
            y1=y, t=t, status=lane.status, steps=lane.steps, rejected=lane.rejected, seen=seen
        )

    def _control(self, direction: Array, first: Array, look: Lookahead | None) -> StepControl:
        control = StepControl(first=first, ts=jnp.zeros(0), watch=self.watch, look=look)
        return control.wrap(direction)


def _in_pieces(
    shared: Field,
    motions: Motions,
    count: Array,
    limits: Limits,
    watch: Watch | None,
    *,
    method: Method,
    each: Callable,
) -> Ends:
    """The same as `integrate`, for rates with conditions; `each` maps a function over the rows."""
    if watch is not None:
        remedy = "Leave the watch out, or give each branch of the rate a phase of its own."
        raise _checks.fail("watch", "a rate without conditions, such as sign", "one", remedy)

    def motion(row) -> Ends:
        i, (y0, t0, t1, numbers) = row
        # Rows that are not needed take no step.
        end = jnp.where(i < count, t1, t0)
        none = jnp.zeros(0)
        field = eqx.combine(numbers, shared)
        found = run_pieces(field, (), y0, t0, end, none, limits, method=method)[0]
        right = found.status == Status.OK
        return Ends(
            y1=found.y1,
            t=jnp.where(right, t1, jnp.nan),
            status=found.status,
            steps=found.steps,
            rejected=found.rejected,
            seen=None,
        )

    return each(motion)((jnp.arange(len(motions.y0)), motions))
