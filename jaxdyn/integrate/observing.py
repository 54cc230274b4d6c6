"""What is observed during the steps of a run: samples, a watch, the step limit, the end.

Samples between steps are not interpolated: an interpolant of matching order would need more stages
than most methods have. A step that would pass a requested time is preceded by a shorter one that
ends there and is not continued from. So samples are as accurate as steps, they do not change the
steps, and the program contains only one step (with a second one for samples it compiled half as
long again, and its loop over stages ran two to five times slower than unrolled stages). A series
may find that a step to a sample is too long: it ends where it may, up to 1 % from where it would
have ended without the sample, and is continued from. The end of the motion then changes by a part
of the tolerance.
"""

import abc
import dataclasses
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._records import Record
from jaxdyn.integrate.lookahead import Lookahead

_CLOSE_ULPS = 100.0  # spacings from the end within which a step is too short; as in diffrax


class Samples(eqx.Module):
    """The states at the wanted times, as the run goes on.

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
        """The samples before the run: those at the start are known, those before it are over."""
        rows = (ts == t0).reshape(-1, *[1] * y0.ndim)
        return cls(jnp.sum(ts <= t0), jnp.where(rows, y0[None], jnp.nan), t0)

    def take(self, ts: Array, t: Array, y: Array) -> "Samples":
        """The samples with the state at t; earlier times still missing were not in order: lost."""

        def reached(samples: Samples) -> Array:
            return (samples.next < len(ts)) & (samples._time(ts) <= t)

        def put(samples: Samples) -> Samples:
            row = jnp.where(samples._time(ts) == t, y, jnp.nan)
            put = jax.lax.dynamic_update_index_in_dim
            return Samples(samples.next + 1, put(samples.ys, row, samples.next, 0), samples.aim)

        return jax.lax.while_loop(reached, put, self)

    def towards(self, ts: Array, t0: Array, aim: Array) -> tuple["Samples", Array]:
        """The samples for a step from t0 to `aim`, and where to go first."""
        t = self._time(ts)
        within = (self.next < len(ts)) & (t0 < t) & (t < aim)
        return Samples(self.next, self.ys, aim), jnp.where(within, t, aim)

    def _time(self, ts: Array) -> Array:
        return ts[jnp.minimum(self.next, len(ts) - 1)]


class StepDecision(NamedTuple):
    """How a run goes on after a step that a watch has seen.

    Attributes:
      keep: () whether it goes on from the end of the step, else again from its start.
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

    @abc.abstractmethod
    def towards(self, direction: Array) -> "Watch":
        """The same for a run in this direction of time: `see` gets direction * t."""

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
      samples: the states at the wanted times.
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
        """() whether the run goes on from its end."""
        return self.fine & ~self.sampling


class Observing(eqx.Module):
    """What adaptive and fixed steps share: samples, a watch, a step limit, the end.

    The limit is not diffrax's `max_steps`, which is a constant of the compiled program. The end is
    not diffrax's either: it halves the step before the end after each one not continued from.

    Attributes:
      ts: (s,) requested times in the direction of integration; (0,) for none.
      watch: the observer of the steps, if any.
      limit: (2,) maximum number of all steps, and of those that stability limits; and () the end of
        the span that must be reached within it. None where steps are counted, and the run is ended,
        elsewhere.
      look: how far a step may go by what the rate hides, if anything limits it.
      max_step: () how far it may go by request, if that is limited.
    """

    ts: eqx.AbstractVar[Array]
    watch: eqx.AbstractVar[Watch | None]
    limit: eqx.AbstractVar[tuple[Array, Array] | None]
    look: eqx.AbstractVar[Lookahead | None]
    max_step: eqx.AbstractVar[Array | None]

    def wrap(self, direction):
        watch = None if self.watch is None else self.watch.towards(direction)
        limit = None if self.limit is None else (self.limit[0], self.limit[1] * direction)
        look = None if self.look is None else self.look.towards(direction)
        ts = self.ts * direction
        return dataclasses.replace(self, ts=ts, watch=watch, limit=limit, look=look)

    def _begin(self, t0: Array, y0: Array, t1: Array) -> tuple[Array, Seen]:
        """Where the first step goes, if it may go to t1, and the memory before it."""
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
            if limited is not None:  # the count of a step that is not kept does not count
                over = over | (keep & (limited >= most[1].astype(float)))
            over = over & ~arrived & (result == diffrax.RESULTS.successful)
            result = diffrax.RESULTS.where(over, diffrax.RESULTS.max_steps_reached, result)
            start = jnp.where(arrived, jnp.inf, start)  # the loop ends there
        return keep, start, tnext, Seen(samples, memory, steps), result


def clip(t: Array, end: Array) -> Array:
    """The time t, or the end where that is closer than a step can be."""
    close = _CLOSE_ULPS * jnp.finfo(t.dtype).eps * jnp.abs(end)
    return jnp.where(t > end - close, end, t)
