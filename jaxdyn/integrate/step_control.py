"""Step-size control, and the observer of accepted steps.

diffrax drives the loop; this controller decides. Unlike diffrax's own PIDController it may also
shorten the step after an accepted one (otherwise 10 to 35 % of the steps on an eccentric orbit are
rejected), it measures each variational column of a state by its own size, and it ends with a
status, instead of trying for ever, when the step falls below the spacing of floating-point times.

Samples between steps are not interpolated: an interpolant of matching order would need more stages
than most methods have. A step that would pass a requested time is preceded by a shorter one that
ends there and is not continued from. So samples are as accurate as steps, they do not change the
steps, and the program contains one step only (a second one for samples compiled for half as long
again, and its loop over stages ran two to five times slower than unrolled stages).
"""

import abc
import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._numerics import square_norm

#: Fraction of the step that would just meet the tolerance. At exponents of 9 to 11 even 0.75 aims
#: at no more than a tenth of the error; 0.9, usual at order 5, gets 10 to 30 % of the steps
#: rejected and costs 10 to 20 % more evaluations at equal true error (measured).
_SAFETY = 0.75
_SHRINK, _GROW = 0.2, 8.0  # limits of one change of step
_MIN_STEP_ULPS = 8.0  # a step shorter than this many spacings of t is meaningless
_MIN_FIXED_STEP_ULPS = 1000.0  # likewise for fixed steps
_MIN_STEP = 1e-100  # [time] likewise at t = 0, where the spacing says nothing
_CLOSE_ULPS = 100.0  # of the end: closer to it a step is too short; as in diffrax
_WRITTEN_OUT = 32  # entries of a state: at most this many products are unrolled in a norm


class Limits(NamedTuple):
    """The limits of a solve, as arrays: new values never recompile.

    Attributes:
      tolerance: (2,) relative and absolute tolerance of one step; (1,) its length, where the method
        takes equal steps.
      max_steps: () largest number of steps.
    """

    tolerance: Array
    max_steps: Array


class Samples(eqx.Module):
    """The states at the wanted times, as the run goes on.

    Attributes:
      next: () index of the first one not reached yet.
      ys: (s, ...) states; NaN where not reached, so that a run that fails leaves no finite wrong
        numbers.
      aim: () where the step in hand ends once all samples within it are taken.
    """

    next: Array
    ys: Array
    aim: Array

    @classmethod
    def empty(cls, ts: Array, t0: Array, y0: Array) -> "Samples":
        """Those at the start are known; a run from t0 to t0 takes no step."""
        at_start = ts == t0
        rows = at_start.reshape(-1, *[1] * y0.ndim)
        return cls(jnp.sum(at_start), jnp.where(rows, y0[None], jnp.nan), t0)

    def taken(self, ts: Array, t: Array, y: Array) -> "Samples":
        """With the state at t; earlier ones that are still missing were not in order, and lost."""

        def reached(samples: Samples) -> Array:
            return (samples.next < len(ts)) & (samples._time(ts) <= t)

        def put(samples: Samples) -> Samples:
            row = jnp.where(samples._time(ts) == t, y, jnp.nan)
            put = jax.lax.dynamic_update_index_in_dim
            return Samples(samples.next + 1, put(samples.ys, row, samples.next, 0), samples.aim)

        return jax.lax.while_loop(reached, put, self)

    def towards(self, ts: Array, t0: Array, aim: Array) -> tuple["Samples", Array]:
        """For a step from t0 to `aim`, and where to go first."""
        t = self._time(ts)
        within = (self.next < len(ts)) & (t0 < t) & (t < aim)
        return Samples(self.next, self.ys, aim), jnp.where(within, t, aim)

    def _time(self, ts: Array) -> Array:
        return ts[jnp.minimum(self.next, len(ts) - 1)]


class Watch(eqx.Module):
    """An observer of accepted steps that may stop the run; see `events`."""

    @abc.abstractmethod
    def towards(self, direction: Array) -> "Watch":
        """The same for a run in this direction of time: `see` gets direction * t."""

    @abc.abstractmethod
    def start(self, t0: Array, y0: Array) -> Any:
        """Its memory at the start."""

    @abc.abstractmethod
    def see(self, keep: Array, t0: Array, y0: Array, t1: Array, y1: Array, memory: Any) -> tuple:
        """Its memory after a step, and whether to stop; a rejected step changes nothing."""


class _Seen(NamedTuple):
    """The memory of a run's observers.

    Attributes:
      samples: the states at the wanted times.
      watch: the memory of the watch, if any.
      steps: () steps so far, also rejected ones; None where they are counted elsewhere.
    """

    samples: Samples
    watch: Any
    steps: Array | None


class _Tried(NamedTuple):
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
        """() whether the run goes on from its end."""
        return self.fine & ~self.sampling


class _Observing(eqx.Module):
    """What adaptive and fixed steps share: samples, a watch, a step limit, the end.

    The limit is not diffrax's `max_steps`, which is a constant of the compiled program; the end is
    not diffrax's either, which halves the step before it after each one that is not continued from.

    Attributes:
      ts: (s,) requested times in the direction of integration; (0,) for none.
      watch: the observer of the steps, if any.
      limit: () maximum number of steps, and () the end of the span that must be reached within
        it; None where steps are counted, and the run is ended, elsewhere.
    """

    ts: eqx.AbstractVar[Array]
    watch: eqx.AbstractVar[Watch | None]
    limit: eqx.AbstractVar[tuple[Array, Array] | None]

    def wrap(self, direction):
        watch = None if self.watch is None else self.watch.towards(direction)
        limit = None if self.limit is None else (self.limit[0], self.limit[1] * direction)
        return dataclasses.replace(self, ts=self.ts * direction, watch=watch, limit=limit)

    def _begin(self, t0: Array, y0: Array, t1: Array) -> tuple[Array, _Seen]:
        """Where the first step goes, if it may go to t1, and the memory before it."""
        memory = None if self.watch is None else self.watch.start(t0, y0)
        steps = None if self.limit is None else jnp.asarray(0)  # weak, as in diffrax
        samples = Samples.empty(self.ts, t0, y0)
        samples, tnext = self._towards(samples, t0, t1)
        return tnext, _Seen(samples, memory, steps)

    def _towards(self, samples: Samples, t0: Array, t1: Array) -> tuple[Samples, Array]:
        aim = t1 if self.limit is None else clipped(t1, self.limit[1])
        return samples.towards(self.ts, t0, aim) if len(self.ts) else (samples, aim)

    def _tried(self, fine, t0, y0, t1, y1, seen: _Seen) -> _Tried:
        sampling = t1 < seen.samples.aim if len(self.ts) else jnp.zeros((), bool)
        return _Tried(fine, sampling, t0, y0, t1, y1)

    def _observe(self, tried: _Tried, following: Array, seen: _Seen, result) -> tuple:
        """What diffrax asks for after a step: where it starts and ends next, memory, result.

        Args:
          tried: the step.
          following: () where the next one may end.
          seen: the memory before.
          result: whether step control has failed.
        """
        keep, t0, t1 = tried.keep, tried.t0, tried.t1
        samples, memory, steps = seen
        start = jnp.where(keep, t1, t0)
        if len(self.ts):
            following = jnp.where(tried.fine & tried.sampling, samples.aim, following)
            samples = samples.taken(self.ts, jnp.where(tried.fine, t1, -jnp.inf), tried.y1)
        samples, tnext = self._towards(samples, start, following)
        if self.watch is not None:
            memory, stop = self.watch.see(keep, t0, tried.y0, t1, tried.y1, memory)
            result = diffrax.RESULTS.where(stop, diffrax.RESULTS.event_occurred, result)
        if self.limit is not None:
            assert steps is not None
            (most, end), steps = self.limit, steps + jnp.where(tried.fine & tried.sampling, 0, 1)
            arrived = keep & (t1 >= end)
            over = (steps >= most) & ~arrived & (result == diffrax.RESULTS.successful)
            result = diffrax.RESULTS.where(over, diffrax.RESULTS.max_steps_reached, result)
            start = jnp.where(arrived, jnp.inf, start)  # diffrax's loop ends there
        return start, tnext, _Seen(samples, memory, steps), result


def clipped(t: Array, end: Array) -> Array:
    """The time t, or the end where that is closer than a step can be."""
    close = _CLOSE_ULPS * jnp.finfo(t.dtype).eps * jnp.abs(end)
    return jnp.where(t > end - close, end, t)


def _mean_square(y: Array) -> Array:
    """Over the first axis; few entries are unrolled, so that a batch is vectorised."""
    if len(y) > _WRITTEN_OUT:
        return jnp.mean(y * y, axis=0)
    return square_norm(jnp.moveaxis(y, 0, -1)) / len(y)


class StepControl(_Observing, diffrax.AbstractAdaptiveStepSizeController):
    """Elementary error-per-step control: h <- 0.75 h (tolerance / error)^(1/p).

    Attributes:
      rtol: () relative tolerance of one step.
      atol: () absolute tolerance of one step.
      ts: (s,) requested times in the direction of integration; (0,) for none.
      watch: the observer of the steps, if any.
      limit: see `_Observing`.
    """

    rtol: Array
    atol: Array
    ts: Array
    watch: Watch | None = None
    limit: tuple[Array, Array] | None = None
    #: diffrax asks for these two names of every adaptive controller.
    norm: ClassVar[Callable] = staticmethod(lambda y: jnp.max(jnp.sqrt(_mean_square(y))))

    def seen(self, state) -> _Seen:
        """The samples, the memory of the watch and the number of steps, from the final state."""
        return state

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        # diffrax's choice of the first step (Hairer, Norsett, Wanner, II.4).
        first = diffrax.PIDController(rtol=self.rtol, atol=self.atol, norm=self.norm)
        tnext, _ = first.init(terms, t0, t1, y0, dt0, args, func, error_order)
        # A NaN rate gives a NaN step; the run must still end.
        tnext = jnp.where(jnp.isfinite(tnext), tnext, t1)
        return self._begin(t0, y0, tnext)

    def adapt_step_size(self, t0, t1, y0, y1_candidate, args, y_error, error_order, state):
        del args
        error = self.norm(y_error / self._scale(y0, y1_candidate))
        error = jnp.where(jnp.isfinite(error), error, jnp.inf)
        tried = self._tried(error <= 1.0, t0, y0, t1, y1_candidate, state)
        h = t1 - t0
        factor = _SAFETY * jnp.maximum(error, 1e-30) ** (-1.0 / error_order)
        h_next = h * jnp.clip(factor, _SHRINK, jnp.where(tried.fine, _GROW, _SAFETY))
        spacing = jnp.finfo(h.dtype).eps * jnp.abs(t0)
        collapsed = ~tried.fine & (h_next <= _MIN_STEP_ULPS * spacing + _MIN_STEP)
        result = diffrax.RESULTS.where(
            collapsed, diffrax.RESULTS.dt_min_reached, diffrax.RESULTS.successful
        )
        following = jnp.where(tried.keep, t1, t0) + h_next
        start, tnext, state, result = self._observe(tried, following, state, result)
        return tried.keep, start, tnext, False, state, result

    def _scale(self, y0: Array, y1: Array) -> Array:
        # y1 may be NaN after a bad step; its error is NaN then and the step is rejected.
        size = jnp.maximum(jnp.abs(y0), jnp.abs(y1))
        if y0.ndim > 1:
            # Column 0 is the state, the others are tangents. A small entry of a tangent need
            # not have more correct digits than its column: use the column's largest entry.
            tangents = jnp.broadcast_to(jnp.max(size, axis=0), size.shape)
            size = jnp.concatenate([size[..., :1], tangents[..., 1:]], axis=-1)
        return self.atol + self.rtol * size


class FixedSteps(_Observing, diffrax.AbstractStepSizeController):
    """n equal steps; the time of each is a multiple of the step, not a sum of steps.

    Attributes:
      n: () how many.
      ts: (s,) requested times in the direction of integration; (0,) for none.
      watch: the observer of the steps, if any.
      limit: see `_Observing`.
    """

    n: Array
    ts: Array
    watch: Watch | None = None
    limit: tuple[Array, Array] | None = None

    def seen(self, state) -> _Seen:
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
        tried = self._tried(jnp.ones((), bool), t0, y0, t1, y1_candidate, seen)
        fine = jnp.isfinite(y1_candidate).all()
        # The last hundred spacings before the end count as the end.
        collapsed = h < _MIN_FIXED_STEP_ULPS * jnp.finfo(h.dtype).eps * jnp.abs(t1)
        result = diffrax.RESULTS.where(
            fine, diffrax.RESULTS.successful, diffrax.RESULTS.nonlinear_divergence
        )
        result = diffrax.RESULTS.where(collapsed, diffrax.RESULTS.dt_min_reached, result)
        done = done + jnp.where(tried.keep, 1.0, 0.0)
        start, tnext, seen, result = self._observe(tried, begin + done * h, seen, result)
        return tried.keep, start, tnext, False, (seen, (begin, h, done)), result


def steps_of(dt: Array, t0: Array, t1: Array) -> Array:
    """() the number of equal steps from t0 to t1, none longer than dt, up to rounding."""
    return jnp.maximum(jnp.ceil(jnp.abs(t1 - t0) / dt * (1 - 1e-12)), 1.0)
