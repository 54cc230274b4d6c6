"""Step-size control, and the observer of accepted steps.

diffrax drives the loop; this controller decides. Unlike diffrax's own PIDController it may also
shorten the step after an accepted one (otherwise 10 to 35 % of the steps on an eccentric orbit are
rejected), it measures each variational column of a state by its own size, and it ends with a
status, instead of trying for ever, when the step falls below the spacing of floating-point times.

Samples between steps are not interpolated. The observer only notes from which accepted node each
requested time can be reached; `flow` then takes one more step of the same method from that node,
so samples are as accurate as the steps (an interpolant of matching order would need more stages
than the method has).
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
_WRITTEN_OUT = 32  # entries of a state: at most this many products are unrolled in a norm


class Limits(NamedTuple):
    """The limits of a solve, as arrays: new values never recompile.

    Attributes:
      tolerance: (2,) relative and absolute tolerance of one step; (1,) its length, where the method
        takes equal steps.
      max_steps: () largest number of steps.
      samples: () how many of the requested times count, where the others only pad the array to
        a length shared by other numbers of samples; None where all count.
    """

    tolerance: Array
    max_steps: Array
    samples: Array | None = None


class Nodes(eqx.Module):
    """For each wanted time, the last accepted node at or before it, as the run goes on."""

    next: Array  # () index of the first sample not reached yet
    t: Array  # (s,) node times
    y: Array  # (s, ...) node states

    @classmethod
    def empty(cls, ts: Array, t0: Array, y0: Array) -> "Nodes":
        """Nodes at which only samples at the start are reached (a run from t0 to t0 takes no step).

        The others are NaN, so that a run that fails leaves no finite wrong numbers.
        """
        at_start = (ts == t0).reshape(-1, *[1] * y0.ndim)
        return cls(
            jnp.zeros((), int),
            jnp.where(ts == t0, t0, jnp.nan),
            jnp.where(at_start, y0[None], jnp.nan),
        )

    def passed(self, ts: Array, t0: Array, y0: Array, t1: Array) -> "Nodes":
        """After an accepted step from (t0, y0) to t1."""

        def reached(nodes: Nodes) -> Array:
            return (nodes.next < len(ts)) & (ts[jnp.minimum(nodes.next, len(ts) - 1)] <= t1)

        def note(nodes: Nodes) -> Nodes:
            i = nodes.next
            put = jax.lax.dynamic_update_index_in_dim
            return Nodes(i + 1, put(nodes.t, t0, i, 0), put(nodes.y, y0, i, 0))

        return jax.lax.while_loop(reached, note, self)


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


class _Observing(eqx.Module):
    """What adaptive and fixed steps share: nodes of the samples, a watch, a step limit.

    The limit is not diffrax's `max_steps`, which is a constant of the compiled program.

    Attributes:
      ts: (s,) requested times in the direction of integration; (0,) for none.
      watch: the observer of the steps, if any.
      limit: () maximum number of steps, and () the end of the span that must be reached within
        it; None where steps are counted elsewhere.
    """

    ts: eqx.AbstractVar[Array]
    watch: eqx.AbstractVar[Watch | None]
    limit: eqx.AbstractVar[tuple[Array, Array] | None]

    def wrap(self, direction):
        watch = None if self.watch is None else self.watch.towards(direction)
        limit = None if self.limit is None else (self.limit[0], self.limit[1] * direction)
        return dataclasses.replace(self, ts=self.ts * direction, watch=watch, limit=limit)

    def _begin(self, t0: Array, y0: Array) -> tuple[Nodes, Any, Array | None]:
        memory = None if self.watch is None else self.watch.start(t0, y0)
        steps = None if self.limit is None else jnp.zeros((), int)
        return Nodes.empty(self.ts, t0, y0), memory, steps

    def _observe(self, keep, t0, y0, t1, y1, seen: tuple, result) -> tuple:
        """The memory after a step, and the result, which also says whether to stop."""
        nodes, memory, steps = seen
        if len(self.ts):
            nodes = nodes.passed(self.ts, t0, y0, jnp.where(keep, t1, -jnp.inf))
        if self.watch is not None:
            memory, stop = self.watch.see(keep, t0, y0, t1, y1, memory)
            result = diffrax.RESULTS.where(stop, diffrax.RESULTS.event_occurred, result)
        if self.limit is not None:
            (most, end), steps = self.limit, steps + 1
            over = (steps >= most) & ~(keep & (t1 >= end)) & (result == diffrax.RESULTS.successful)
            result = diffrax.RESULTS.where(over, diffrax.RESULTS.max_steps_reached, result)
        return (nodes, memory, steps), result


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

    def seen(self, state) -> tuple[Nodes, Any]:
        """The nodes of the samples and the memory of the watch, from the final state."""
        return state[:2]

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        # diffrax's choice of the first step (Hairer, Norsett, Wanner, II.4).
        first = diffrax.PIDController(rtol=self.rtol, atol=self.atol, norm=self.norm)
        tnext, _ = first.init(terms, t0, t1, y0, dt0, args, func, error_order)
        # A NaN rate gives a NaN step; the run must still end.
        tnext = jnp.where(jnp.isfinite(tnext), tnext, t1)
        return tnext, self._begin(t0, y0)

    def adapt_step_size(self, t0, t1, y0, y1_candidate, args, y_error, error_order, state):
        del args
        error = self.norm(y_error / self._scale(y0, y1_candidate))
        error = jnp.where(jnp.isfinite(error), error, jnp.inf)
        keep = error <= 1.0
        h = t1 - t0
        factor = _SAFETY * jnp.maximum(error, 1e-30) ** (-1.0 / error_order)
        h_next = h * jnp.clip(factor, _SHRINK, jnp.where(keep, _GROW, _SAFETY))
        spacing = jnp.finfo(h.dtype).eps * jnp.abs(t0)
        collapsed = ~keep & (h_next <= _MIN_STEP_ULPS * spacing + _MIN_STEP)
        start = jnp.where(keep, t1, t0)
        result = diffrax.RESULTS.where(
            collapsed, diffrax.RESULTS.dt_min_reached, diffrax.RESULTS.successful
        )
        state, result = self._observe(keep, t0, y0, t1, y1_candidate, state, result)
        return keep, start, start + h_next, False, state, result

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

    def seen(self, state) -> tuple[Nodes, Any]:
        """The nodes of the samples and the memory of the watch, from the final state."""
        return state[0][:2]

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        del terms, dt0, args, func, error_order
        h = (t1 - t0) / self.n
        tnext = jnp.where(jnp.isfinite(h), t0 + h, t1)  # the run must still end
        return tnext, (self._begin(t0, y0), (t0, h, jnp.ones(())))

    def adapt_step_size(self, t0, t1, y0, y1_candidate, args, y_error, error_order, state):
        del args, y_error, error_order
        seen, (begin, h, done) = state
        fine = jnp.isfinite(y1_candidate).all()
        # diffrax treats the last hundred spacings before the end as the end.
        collapsed = h < _MIN_FIXED_STEP_ULPS * jnp.finfo(h.dtype).eps * jnp.abs(t1)
        result = diffrax.RESULTS.where(
            fine, diffrax.RESULTS.successful, diffrax.RESULTS.nonlinear_divergence
        )
        result = diffrax.RESULTS.where(collapsed, diffrax.RESULTS.dt_min_reached, result)
        seen, result = self._observe(fine, t0, y0, t1, y1_candidate, seen, result)
        tnext = begin + (done + 1) * h
        return True, t1, tnext, False, (seen, (begin, h, done + 1)), result


def steps_of(dt: Array, t0: Array, t1: Array) -> Array:
    """() the number of equal steps from t0 to t1, none longer than dt, up to rounding."""
    return jnp.maximum(jnp.ceil(jnp.abs(t1 - t0) / dt * (1 - 1e-12)), 1.0)
