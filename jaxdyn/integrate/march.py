"""The loop over the steps of a motion: the only caller of ``diffrax.diffeqsolve``.

`march` takes a smooth field from a start to an end, with samples and an observer of the steps. It
leaves derivatives to `flow`, conditions of a rate to `pieces`, and events to `event_search`.
"""

import abc
import dataclasses
import functools
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn._numerics import UNROLLED_ENTRIES, rough_power, square_norm
from jaxdyn._records import Record
from jaxdyn.plan import Plan, plan_of
from jaxdyn.plan.branch import InBranch
from jaxdyn.plan.plan import without_wrappers
from jaxdyn.plan.times import furthest_seen, is_hidden, sizes
from jaxdyn.solvers.formulas.formulas import simplify
from jaxdyn.solvers.method import STEP_SAFETY, Method, operations
from jaxdyn.solvers.stepper import (
    PART,
    AtStart,
    StepLoop,
    Stepper,
    above_noise,
    allowed_error,
    is_stiff,
    sizes_at_start,
    state_of,
    without_derivatives,
)
from jaxdyn.status import Status

# ---- Steps that do not pass over brief parts of a rate: those in time alone are seen ahead
#
# A method judges a step by what it sees of the rate at a handful of times, and misses a pulse
# between them. So before a step is taken, bounds of each part of the rate that depends on time
# alone are compared with samples of it (`plan.times`), and a step in which more may happen than is
# seen becomes shorter. Parts that depend on time and state are checked likewise after a step, and
# a step in which something may be hidden is rejected.

#: An entry smaller than this part of the size that the forcing gives it later is at rest.
_REST = 1e-6
#: Number of halvings of a span in search of the beginning of the forcing. It begins in the second
#: half if in the first its largest rate is less than this part of that in both. By this measure
#: powers of time up to the ninth begin at the start.
_HALVES, _FALL = 48, 1e-3


class Lookahead(eqx.Module):
    """How far a step may go without passing over parts of a rate that depend on time alone.

    Attributes:
      plan: the plan of the rate.
      system: the field, of the plan's kind.
      outcomes: (e,) outcomes of the conditions of the rate.
      sizes: (u,) the largest sizes of the parts in the span, as far as they are known.
      direction: () 1, or -1 where the run counts time backwards.
    """

    plan: Plan = eqx.field(static=True)
    system: Any
    outcomes: Array
    sizes: Array
    direction: Array | float = 1.0

    def towards(self, direction: Array) -> "Lookahead":
        """The same for a run in this direction of time, in which times are direction * t."""
        return dataclasses.replace(self, direction=direction)

    def has_hidden(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array:
        """Whether () functions of time and state may have acted within a step, unseen."""
        ends = []
        for t, y in ((self.direction * t0, y0), (self.direction * t1, y1)):
            x = state_of(y)
            ends.append((t, x, self.system.rate(t, x)))
        return is_hidden(self.plan, self.system, self.outcomes, *ends)

    def until(self, t0: Array, t1: Array) -> Array:
        """() the end of a step from t0 that goes up to t1 unless something may be hidden in it."""
        if not self.plan.hides:
            return t1
        t0, end = self.direction * t0, self.direction * t1
        seen = furthest_seen(self.plan, self.system, t0, end, self.outcomes, self.sizes)
        return jnp.where(self.direction * seen == t1, t1, self.direction * seen)


def _sizes_of_forcing(look: Lookahead, t0: Array, t1: Array, y: Array, start: AtStart) -> AtStart:
    """The start with sizes for entries at rest that a forcing moves later in the span.

    An entry without a size, or with a negligible one, gets a part of the change that the largest
    rate makes in the time of the motion; then the entries that it moves in turn get sizes in the
    same way. Relative to its own size, the beginning of a pulse would be resolved down to rounding.

    The span may be a mere limit, up to which a forcing such as t^4 grows far beyond the motion that
    is asked for. So the largest rate is that in half the span, a quarter and so on, down to the
    last part before it drops abruptly: in a shorter one the forcing has not begun, or is rounding.
    """
    ends = t0 + (t1 - t0) * 0.5 ** np.arange(_HALVES)
    low, high = jnp.minimum(t0, ends), jnp.maximum(t0, ends)
    found = jax.vmap(lambda a, b: look.plan.bounds_of_rate(look.system, a, b, y))(low, high)
    rates = jnp.maximum(jnp.abs(found.low), jnp.abs(found.high))
    rates = jnp.where(jnp.isfinite(rates), rates, 0.0)
    gradual = jnp.cumprod(rates[1:] > _FALL * rates[:-1], axis=0)
    most = jnp.take_along_axis(rates, jnp.sum(gradual, axis=0)[None], axis=0)[0]

    def filled(sizes: Array, rates: Array) -> Array:
        rates = jnp.where(jnp.isfinite(rates), jnp.abs(rates), 0.0)
        later = PART * start.time * rates
        return jnp.where(sizes > _REST * later, sizes, later)

    sizes = filled(start.sizes, most)
    sizes = filled(sizes, look.system.rate(t0, y + sizes))
    return start._replace(sizes=look.system.groups.sizes(sizes))


def look_from_start(
    field: Any, t0: Array, y0: Array, t1: Array, tolerance: Array, method: Method
) -> tuple[AtStart, Lookahead | None]:
    """What is known at the start of a motion, and what steps from there must not pass over.

    Where only rounding moves a system at rest, no step of an explicit method is short enough to
    resolve that motion, so sizes are raised to the change by rounding in the time of the motion.
    For a stiff link, which reverses any motion at once, this would be far too much: sizes are kept
    for methods that damp, which do not resolve its vibrations.
    """
    driven = plan_of(without_wrappers(field), len(y0)).depends_on_time
    start = sizes_at_start(field, t0, y0, t1, driven=driven)
    look = lookahead(field, len(y0), t0, t1)
    if look is not None and look.plan.hides and y0.ndim == 1:
        start = _sizes_of_forcing(look, t0, t1, y0, start)
    return start if method.damps else above_noise(start, tolerance), look


def lookahead(
    field: Any, k: int, t0: Array, t1: Array, largest: Array | None = None
) -> Lookahead | None:
    """What steps of a field with a state (k, ...) must not pass over; None if there is nothing.

    Args:
      field: see `integrate.flow`.
      k: number of entries of the state.
      t0: () start of the span.
      t1: () its end.
      largest: the `Lookahead.sizes`, where they are known.
    """
    field = without_wrappers(field)
    system = field.field if isinstance(field, InBranch) else field
    plan = plan_of(system, k)
    if not (plan.hides or plan.mixed):
        return None
    outcomes = field.branch.outcomes if isinstance(field, InBranch) else jnp.zeros(plan.size)
    if largest is None:
        largest = sizes(plan, system, t0, t1, outcomes)
    return Lookahead(plan, system, outcomes, largest)


# ---- What is observed during the steps of a run: samples, a watch, the step limit, the end
#
# Samples between steps are not interpolated: an interpolant of matching order would need more
# stages than most methods have. A step that would pass a requested time is preceded by a shorter
# one that ends there and is not continued from. So samples are as accurate as steps, they do not
# change the steps, and the program contains only one step (with a second one for samples it
# compiled half as long again, and its loop over stages ran two to five times slower than unrolled
# stages). A series may find that a step to a sample is too long: the step then ends earlier, up to
# 1 % from where it would have ended without the sample, and is continued from. The end of the
# motion then changes by a part of the tolerance.

_CLOSE_ULPS = 100.0  # spacings from the end within which a step is too short; as in diffrax


class Samples(eqx.Module):
    """The states at the requested times, filled in as the run proceeds.

    Attributes:
      next: () index of the first time not reached yet.
      ys: (s, ...) states; NaN where not reached, so that a run that fails leaves no finite wrong
        numbers.
      aim: () where the current step ends once all samples within it are taken.
    """

    next: Array
    ys: Array
    aim: Array

    @classmethod
    def empty(cls, ts: Array, t0: Array, y0: Array) -> "Samples":
        """The samples before the run: those at the start are known, earlier times are passed."""
        rows = (ts == t0).reshape(-1, *[1] * y0.ndim)
        return cls(jnp.sum(ts <= t0), jnp.where(rows, y0[None], jnp.nan), t0)

    def take(self, ts: Array, t: Array, y: Array) -> "Samples":
        """The samples with the state at t; earlier times, which were out of order, get NaN."""

        def reached(samples: Samples) -> Array:
            return (samples.next < len(ts)) & (samples._time(ts) <= t)

        def put(samples: Samples) -> Samples:
            row = jnp.where(samples._time(ts) == t, y, jnp.nan)
            put = jax.lax.dynamic_update_index_in_dim
            return Samples(samples.next + 1, put(samples.ys, row, samples.next, 0), samples.aim)

        return jax.lax.while_loop(reached, put, self)

    def towards(self, ts: Array, t0: Array, aim: Array) -> tuple["Samples", Array]:
        """The samples for a step from t0 to `aim`, and where a first step should end."""
        t = self._time(ts)
        within = (self.next < len(ts)) & (t0 < t) & (t < aim)
        return Samples(self.next, self.ys, aim), jnp.where(within, t, aim)

    def _time(self, ts: Array) -> Array:
        return ts[jnp.minimum(self.next, len(ts) - 1)]


class StepDecision(NamedTuple):
    """How a run continues after a step that a watch has seen.

    Attributes:
      keep: () whether it continues from the end of the step; otherwise it repeats the step.
      following: () the time at which the next step may end.
      memory: the memory of the watch.
      stop: () whether the run ends here.
    """

    keep: Array
    following: Array
    memory: Any
    stop: Array


class Watch(Record):
    """An observer of accepted steps that may stop the run; see `events`."""

    def towards(self, direction: Array) -> "Watch":
        """The same for a run in this direction of time: `see` gets direction * t.

        By default this sets the watch's field ``direction``.
        """
        return dataclasses.replace(self, direction=direction)

    @abc.abstractmethod
    def start(self, t0: Array, y0: Array) -> Any:
        """The memory at the start."""

    @abc.abstractmethod
    def see(self, keep: Array, t0: Array, y0: Array, t1: Array, y1: Array, memory: Any) -> tuple:
        """The memory after a step, and whether to stop; a rejected step changes nothing."""

    def steer(self, keep, t0, y0, t1, y1, memory, following: Array) -> StepDecision:
        """The same as `see`, for a watch that also decides where the next step begins and ends.

        By default neither is changed. Adaptive methods only.
        """
        memory, stop = self.see(keep, t0, y0, t1, y1, memory)
        return StepDecision(keep=keep, following=following, memory=memory, stop=stop)


class Seen(NamedTuple):
    """The memory of a run's observers.

    Attributes:
      samples: the states at the requested times.
      watch: the memory of the watch, if any.
      steps: () steps so far, also rejected ones; None where they are counted elsewhere.
    """

    samples: Samples
    watch: Any
    steps: Array | None


class StepAttempt(NamedTuple):
    """A step, as its observers see it.

    Attributes:
      fine: () whether it is accurate enough.
      sampling: () whether it ended at a sample, and is not continued from.
      t0: () its start.
      y0: (k, ...) the state there.
      t1: () its end.
      y1: (k, ...) the state there.
    """

    fine: Array
    sampling: Array
    t0: Array
    y0: Array
    t1: Array
    y1: Array

    @property
    def keep(self) -> Array:
        """() whether the run continues from its end."""
        return self.fine & ~self.sampling


class ObservedControl(eqx.Module):
    """What adaptive and fixed steps share: samples, a watch, a step limit, the end.

    The limit is not diffrax's `max_steps`, which is a constant of the compiled program. Nor is the
    end left to diffrax, which halves the step before it after each one not continued from.

    Attributes:
      ts: (s,) requested times in the direction of integration; (0,) for none.
      watch: the observer of the steps, if any.
      limit: (2,) maximum number of all steps, and of those that stability limits; and () the end of
        the span that must be reached within it. None where steps are counted, and the run is ended,
        elsewhere.
      look: how far a step may go without missing brief parts of the rate; None for any distance.
      max_step: () length of the longest step by request; None if there is no such limit.
    """

    ts: Array = eqx.field(kw_only=True)
    watch: Watch | None = eqx.field(kw_only=True, default=None)
    limit: tuple[Array, Array] | None = eqx.field(kw_only=True, default=None)
    look: Lookahead | None = eqx.field(kw_only=True, default=None)
    max_step: Array | None = eqx.field(kw_only=True, default=None)

    def wrap(self, direction):
        watch = None if self.watch is None else self.watch.towards(direction)
        limit = None if self.limit is None else (self.limit[0], self.limit[1] * direction)
        look = None if self.look is None else self.look.towards(direction)
        ts = self.ts * direction
        return dataclasses.replace(self, ts=ts, watch=watch, limit=limit, look=look)

    def _begin(self, t0: Array, y0: Array, t1: Array) -> tuple[Array, Seen]:
        """The end of the first step, which may not go beyond t1, and the memory before it."""
        memory = None if self.watch is None else self.watch.start(t0, y0)
        steps = None if self.limit is None else jnp.asarray(0)  # weak, as in diffrax
        samples = Samples.empty(self.ts, t0, y0)
        samples, tnext = self._towards(samples, t0, t1)
        return tnext, Seen(samples, memory, steps)

    def _towards(self, samples: Samples, t0: Array, t1: Array) -> tuple[Samples, Array]:
        aim = t1 if self.limit is None else clip(t1, self.limit[1])
        if self.max_step is not None:
            aim = jnp.minimum(aim, t0 + self.max_step)
        aim = aim if self.look is None else self.look.until(t0, aim)
        return samples.towards(self.ts, t0, aim) if len(self.ts) else (samples, aim)

    def _try(self, fine, t0, y0, t1, y1, seen: Seen) -> StepAttempt:
        sampling = t1 < seen.samples.aim if len(self.ts) else jnp.zeros((), bool)
        return StepAttempt(fine, sampling, t0, y0, t1, y1)

    def _observe(
        self, tried: StepAttempt, following: Array, seen: Seen, result, limited: Array | None = None
    ) -> tuple:
        """What diffrax asks for after a step: keep it, next start and end, memory, result.

        Args:
          tried: the step.
          following: () where the next one may end.
          seen: the memory before.
          result: whether step control has failed.
          limited: () number of steps that stability limited, if it is counted.
        """
        keep, t0, t1 = tried.keep, tried.t0, tried.t1
        samples, memory, steps = seen
        if self.watch is not None:
            keep, following, memory, stop = self.watch.steer(
                keep, t0, tried.y0, t1, tried.y1, memory, following
            )
            result = diffrax.RESULTS.where(stop, diffrax.RESULTS.event_occurred, result)
        start = jnp.where(keep, t1, t0)
        if len(self.ts):
            following = jnp.where(tried.fine & tried.sampling, samples.aim, following)
            samples = samples.take(self.ts, jnp.where(tried.fine, t1, -jnp.inf), tried.y1)
        samples, tnext = self._towards(samples, start, following)
        if self.limit is not None:
            assert steps is not None
            (most, end), steps = self.limit, steps + jnp.where(tried.fine & tried.sampling, 0, 1)
            arrived = keep & (t1 >= end)
            over = steps >= most[0]
            if limited is not None:  # a step that is not kept does not change the count
                over = over | (keep & (limited >= most[1].astype(float)))
            over = over & ~arrived & (result == diffrax.RESULTS.successful)
            result = diffrax.RESULTS.where(over, diffrax.RESULTS.max_steps_reached, result)
            start = jnp.where(arrived, jnp.inf, start)  # the loop ends there
        return keep, start, tnext, Seen(samples, memory, steps), result


def clip(t: Array, end: Array) -> Array:
    """The time t, or the end if t is beyond it or closer to it than a step can be."""
    close = _CLOSE_ULPS * jnp.finfo(t.dtype).eps * jnp.abs(end)
    return jnp.where(t > end - close, end, t)


# ---- Step-size control
#
# `StepLoop` drives the loop; this controller decides. Unlike diffrax's own PIDController it may
# also shorten the step after an accepted one (otherwise 10 to 35 % of the steps on an eccentric
# orbit are rejected), it measures each variational column of a state by its own size, and it ends
# with a status, instead of trying for ever, when the step falls below the spacing of floating-point
# times.

_SHRINK, _GROW = 0.2, 8.0  # limits of one change of step
#: A method that can predict how long a step may be gets this factor times that length as its next
#: step; a step that is nevertheless too long is repeated with the second factor. (A power of the
#: error would take a tenth of the time of a step to compute.)
_PROPOSED, _TOO_LONG = 1.3, 0.5
_MIN_STEP_ULPS = 8.0  # a step shorter than this many spacings of t is meaningless
_MIN_FIXED_STEP_ULPS = 1000.0  # likewise for fixed steps
_MIN_STEP = 1e-100  # [time] likewise at t = 0, where the spacing says nothing
#: Error of the first step, in tolerances, if errors were proportional to the power of the length
#: (as in Hairer, Norsett, Wanner, II.4).
_FIRST_ERROR = 0.01


class Limits(NamedTuple):
    """The limits of a solve, as arrays: new values never recompile.

    Attributes:
      tolerance: (3,) relative and absolute tolerance of one step, and an absolute one in parts of
        the sizes of the motion; (1,) the length of a step, where the method takes equal ones.
      max_steps: (2,) largest number of all steps, and of those that stability limits.
      max_step: () longest step; None if nothing limits it.
      breaks: (b,) times at which steps end, for what cannot be read from a rate.
    """

    tolerance: Array
    max_steps: Array
    max_step: Array | None = None
    breaks: Array | tuple = ()

    def with_steps(self, left: Array) -> "Limits":
        """The same with another number of steps."""
        return self._replace(max_steps=jnp.stack([left, self.max_steps[1]]))

    def until_stiff(self, most: int) -> "Limits":
        """The same with another net number of steps that stability limits; not inside a trace."""
        return self._replace(max_steps=np.array([self.max_steps[0], most]))


def _mean_square(y: Array) -> Array:
    """The mean square over the first axis; few entries are unrolled, to vectorise a batch."""
    if len(y) > UNROLLED_ENTRIES:
        return jnp.mean(y * y, axis=0)
    return square_norm(jnp.moveaxis(y, 0, -1)) / len(y)


def _spacing(t: Array) -> Array:
    """() the spacing of floating-point times near t, within a factor of two."""
    return jnp.finfo(t.dtype).eps * jnp.abs(t)


class StepControl(ObservedControl, diffrax.AbstractStepSizeController):
    """Elementary error-per-step control: h <- 0.75 h (tolerance / error)^(1/p).

    Attributes:
      first: () length of the first step.
    """

    first: Array
    norm: ClassVar[Callable] = staticmethod(lambda y: jnp.max(jnp.sqrt(_mean_square(y))))

    def seen(self, state) -> Seen:
        """The samples, the memory of the watch and the number of steps, from the final state."""
        return state

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        del terms, dt0, args, func, error_order
        # A step shorter than the spacing of times would not advance, nor would any after it.
        tnext = t0 + jnp.maximum(self.first, _MIN_STEP_ULPS * _spacing(t0))
        # A NaN rate gives a NaN step; the run must still end.
        tnext = jnp.where(jnp.isfinite(tnext), tnext, t1)
        return self._begin(t0, y0, tnext)

    def adapt_step_size(self, t0, t1, y0, y1_candidate, args, y_error, error_order, state):
        del args
        error, may, end, reach, square, limited = y_error
        if square is None:
            # Where the new state is NaN so is the allowed error, and the step is rejected.
            error = self.norm(error / may)
        else:
            # The error is not finite where the new state is not.
            error = square + 0.0 * jnp.sum(y1_candidate)
        if self.look is not None and self.look.plan.mixed:
            there = t1 if end is None else end
            hidden = self.look.has_hidden(t0, y0, there, y1_candidate)
            error = jnp.where(hidden, jnp.inf, error)
        shorter = jnp.zeros((), bool) if end is None else end < t1
        tried = self._try(error <= 1.0, t0, y0, t1, y1_candidate, state)
        end = t1 if end is None else end
        tried = tried._replace(sampling=tried.sampling & ~shorter, t1=end)
        h = end - t0
        if reach is None:
            error = jnp.where(jnp.isfinite(error), error, jnp.inf)
            factor = STEP_SAFETY * rough_power(jnp.maximum(error, 1e-30), -1.0 / error_order)
            h_next = h * jnp.clip(factor, _SHRINK, jnp.where(tried.fine, _GROW, STEP_SAFETY))
        else:
            longer = (t1 - t0) * jnp.minimum(_PROPOSED * reach, _GROW)
            h_next = jnp.where(tried.fine, longer, _TOO_LONG * h)
        shortest = _MIN_STEP_ULPS * _spacing(t0) + _MIN_STEP
        collapsed = (~tried.fine | shorter) & (h_next <= shortest)
        result = diffrax.RESULTS.where(
            collapsed, diffrax.RESULTS.dt_min_reached, diffrax.RESULTS.successful
        )
        following = jnp.where(tried.keep, end, t0) + h_next
        keep, start, tnext, state, result = self._observe(tried, following, state, result, limited)
        return keep, start, tnext, False, state, result


def first_step(method: Method, tolerance: Array, start: AtStart, y0: Array) -> Array:
    """() length of the first step, if its error is about a power of its length per time scale.

    The time scale is that of the motion, or the time in which the fastest entry changes by its
    size, whichever is shorter.

    Args:
      method: takes a tolerance.
      tolerance: (3,) see `Limits`.
      start: sizes, time and rate at the start.
      y0: (k, ...) start.
    """
    while y0.ndim > 1:
        y0, start = y0[..., 0], start._replace(sizes=start.sizes[..., 0])
    known = start.sizes > 0
    sizes = jnp.where(known, start.sizes, 1.0)
    speed = jnp.max(jnp.where(known, jnp.abs(start.rate) / sizes, 0.0))
    speed = jnp.maximum(speed, 1.0 / start.time)
    may = allowed_error(tolerance, start.sizes, y0, y0)
    share = jnp.min(jnp.where(known, may / sizes, jnp.inf))
    share = jnp.where(jnp.isfinite(share), jnp.minimum(share, 1.0), 1.0)
    return (_FIRST_ERROR * share) ** (1.0 / method.error_order) / speed


class FixedSteps(ObservedControl, diffrax.AbstractStepSizeController):
    """n equal steps; the time of each is a multiple of the step, not a sum of steps.

    Attributes:
      n: () number of steps.
    """

    n: Array

    def seen(self, state) -> Seen:
        """The samples, the memory of the watch and the number of steps, from the final state."""
        return state[0]

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        del terms, t1, dt0, args, func, error_order
        assert self.limit is not None
        end = self.limit[1]
        h = (end - t0) / self.n
        first = jnp.where(jnp.isfinite(h), t0 + h, end)  # the run must still end
        tnext, seen = self._begin(t0, y0, first)
        return tnext, (seen, (t0, h, jnp.ones(())))

    def adapt_step_size(self, t0, t1, y0, y1_candidate, args, y_error, error_order, state):
        del args, y_error, error_order
        seen, (begin, h, done) = state
        tried = self._try(jnp.ones((), bool), t0, y0, t1, y1_candidate, seen)
        fine = jnp.isfinite(y1_candidate).all()
        # The last hundred spacings before the end count as the end.
        collapsed = h < _MIN_FIXED_STEP_ULPS * _spacing(t1)
        result = diffrax.RESULTS.where(
            fine, diffrax.RESULTS.successful, diffrax.RESULTS.nonlinear_divergence
        )
        result = diffrax.RESULTS.where(collapsed, diffrax.RESULTS.dt_min_reached, result)
        done = done + jnp.where(tried.keep, 1.0, 0.0)
        keep, start, tnext, seen, result = self._observe(tried, begin + done * h, seen, result)
        return keep, start, tnext, False, (seen, (begin, h, done)), result


def steps_of(dt: Array, t0: Array, t1: Array) -> Array:
    """() the number of equal steps from t0 to t1, none longer than dt, up to rounding."""
    return jnp.maximum(jnp.ceil(jnp.abs(t1 - t0) / dt * (1 - 1e-12)), 1.0)


# ---- The loop over the steps

#: Operations of a rate above which a loop over stages runs as fast as unrolled stages and
#: compiles ten times sooner (measured: three bodies 80, double pendulum 590).
UNROLLED_BELOW = 200


class SolveResult(Record):
    """States along a trajectory.

    Attributes:
      y1: (k,) state at the end; NaN if it was not reached.
      ys: (s, k) states at the requested times; NaN where not reached.
      steps: () accepted steps.
      rejected: () rejected steps.
      status: () `Status` code.
      stiff: () whether stability, not accuracy, limited the steps of an explicit method; `RADAU9`
        may have taken over, see `simulate`.
    """

    y1: Array
    ys: Array
    steps: Array
    rejected: Array
    status: Annotated[Array, Status]
    stiff: Array

    __repr__ = _text.fields
    _repr_html_ = _text.html


class History(NamedTuple):
    """What the earlier pieces of a motion have shown.

    Attributes:
      sizes: (k, ...) the sizes of the motion, see `solvers.stepper`.
      step: () the longest mean step of a piece.
    """

    sizes: Array
    step: Array


def march(
    field,
    y0,
    t0,
    t1,
    ts,
    limits,
    *,
    method: Method,
    watch: Watch | None = None,
    before: History | None = None,
    loop: StepLoop | None = None,
):
    """States of a smooth motion, the final memory of a watch, its sizes; without derivatives.

    Args:
      field: see `flow`; its conditions are evaluated as they are.
      y0: (k, ...) start.
      t0: () start time.
      t1: () end time, before or after t0.
      ts: (s,) requested times; those before t0, if any, are not reached.
      limits: see `flow`.
      method: the method.
      watch: an observer of the steps, which may stop the run.
      before: what earlier pieces of the motion have shown, if this is a piece of one.
      loop: the loop over steps; one in reverse gives derivatives by the field and the start.
    """
    direction = jnp.where(t1 > t0, 1.0, -1.0)  # as in diffrax, also for t1 = t0
    rate = _by_formulas if method.evaluates else _rate
    wide = watch is not None or y0.ndim > 1
    if wide or operations(lambda t, y: rate(t, y, field), t0, y0) > UNROLLED_BELOW:
        method = method.in_loops(1)
    known, begin = (field, y0) if loop is None else without_derivatives((field, y0))
    start, control, h = _control(known, begin, t0, t1, ts, limits, method, watch, before)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        Stepper(method, limits.tolerance, start.sizes if method.adaptive else None, h, start.time),
        t0,
        t1 + (t1 - t0),  # never reached: the step control ends the run
        None,
        y0,
        args=field,
        stepsize_controller=control,
        saveat=diffrax.SaveAt(t1=True, controller_state=True, solver_state=True),
        max_steps=None,  # counted by the controller: diffrax compiles its limit in
        adjoint=StepLoop() if loop is None else loop,
        throw=False,  # a throw is a host callback, which keeps programs out of the cache
    )
    # The logarithms are finite for positive tolerances only; one of the last two may be zero.
    tolerance = limits.tolerance
    given = (y0, start.rate, t0, t1, jnp.log(tolerance[0]), jnp.log(tolerance[-2:].sum()))
    ts_end, ys_end, state = solution.ts, solution.ys, solution.solver_state
    assert ts_end is not None  # all three are saved, see above
    assert ys_end is not None
    assert state is not None
    count = state[1]
    status = _status(solution.result, given, count >= limits.max_steps[1].astype(float))
    # Times increase; they are beyond t1 where the step control has ended the run there.
    last = jnp.minimum(direction * ts_end[-1], direction * t1)
    ends = jnp.stack([t0, direction * last]), jnp.stack([y0, ys_end[-1]])
    status = _check_constraints(field, ends, status)
    y1 = jnp.where(status == Status.OK, ys_end[-1], jnp.nan)
    seen, steps = control.seen(solution.controller_state), solution.stats["num_accepted_steps"]
    # States within a step that failed do not count.
    reached = (direction * ts <= last).reshape(-1, *[1] * y0.ndim)
    result = SolveResult(
        y1=y1,
        ys=jnp.where(reached, seen.samples.ys, jnp.nan),
        steps=steps,
        rejected=seen.steps - steps,  # steps to samples are counted in neither
        status=status,
        stiff=is_stiff(count),
    )
    return result, seen.watch, state[2]


def _control(field, y0, t0, t1, ts, limits, method: Method, watch, before: History | None):
    """What is known at the start, the step control, and the length of steps where it is fixed.

    One program for both directions of time: diffrax negates ts with the rest.
    """
    tolerance, most = limits.tolerance, (limits.max_steps, t1)
    if not method.adaptive:
        n = steps_of(tolerance[0], t0, t1)
        h, control = (t1 - t0) / n, FixedSteps(n=n, ts=ts, watch=watch, limit=most)
        return AtStart(jnp.zeros_like(y0), jnp.abs(t1 - t0), field.rate(t0, y0)), control, h
    start, look = look_from_start(field, t0, y0, t1, tolerance, method)
    if before is not None:
        start = start._replace(sizes=jnp.maximum(start.sizes, before.sizes))
    first = first_step(method, tolerance, start, y0)
    first = first if before is None else jnp.maximum(first, before.step)
    control = StepControl(
        first=first, ts=ts, watch=watch, limit=most, look=look, max_step=limits.max_step
    )
    return start, control, None


# Traced once for all uses of a rate in a step, its preparation and its checks.
@functools.partial(jax.jit, inline=True)
def _rate(t, y, field):
    return field.rate(t, y)


@functools.partial(jax.jit, inline=True)
def _by_formulas(t, y, field):
    return simplify(field.rate)(t, y)


def _check_constraints(field, ends: tuple[Array, Array], status: Array) -> Array:
    """The status, or SINGULAR if constraints leave an acceleration undetermined at an end."""
    undetermined = jax.lax.map(lambda end: field.undetermined(*end), ends)
    if undetermined is None:
        return status
    return jnp.where(undetermined.any(), int(Status.SINGULAR), status)


def _status(result, given: tuple[Array, ...], limited: Array) -> Array:
    meanings = (
        (diffrax.RESULTS.max_steps_reached, Status.STEP_LIMIT),
        (diffrax.RESULTS.dt_min_reached, Status.STEP_COLLAPSED),
        (diffrax.RESULTS.nonlinear_divergence, Status.STEP_TOO_LONG),
    )
    status = jnp.asarray(int(Status.OK))
    for code, meaning in meanings:
        status = jnp.where(result == code, int(meaning), status)
    status = jnp.where(limited & (status == Status.STEP_LIMIT), int(Status.STIFF), status)
    # One test for all: each costs XLA on CPU a quarter of a microsecond of memory management.
    finite = jnp.isfinite(jnp.concatenate([x.ravel() for x in given])).all()
    return jnp.where(finite, status, int(Status.NOT_FINITE))
