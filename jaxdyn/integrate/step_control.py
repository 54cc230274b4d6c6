"""Step-size control.

`Stepping` drives the loop; this controller decides. Unlike diffrax's own PIDController it may also
shorten the step after an accepted one (otherwise 10 to 35 % of the steps on an eccentric orbit are
rejected), it measures each variational column of a state by its own size, and it ends with a
status, instead of trying for ever, when the step falls below the spacing of floating-point times.
"""

from collections.abc import Callable
from typing import ClassVar, NamedTuple

import diffrax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import rough_power, square_norm
from jaxdyn.integrate.lookahead import Lookahead
from jaxdyn.integrate.observing import Observing, Seen, Watch
from jaxdyn.solvers.method import SAFETY, Method
from jaxdyn.solvers.sizes import AtStart, allowed_error

_SHRINK, _GROW = 0.2, 8.0  # limits of one change of step
#: A method that can predict how long a step may be is offered this factor times that length as its
#: next step; a step that was nevertheless too long is repeated with the second factor. A power of
#: the error would take a tenth of the time of a step.
_PROPOSED, _TOO_LONG = 1.3, 0.5
_MIN_STEP_ULPS = 8.0  # a step shorter than this many spacings of t is meaningless
_MIN_FIXED_STEP_ULPS = 1000.0  # likewise for fixed steps
_MIN_STEP = 1e-100  # [time] likewise at t = 0, where the spacing says nothing
#: Error of the first step, in tolerances, if errors were proportional to the power of the length
#: (as in Hairer, Norsett, Wanner, II.4).
_FIRST_ERROR = 0.01
_WRITTEN_OUT = 32  # entries of a state: at most this many products are unrolled in a norm


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
    if len(y) > _WRITTEN_OUT:
        return jnp.mean(y * y, axis=0)
    return square_norm(jnp.moveaxis(y, 0, -1)) / len(y)


def _spacing(t: Array) -> Array:
    """() the spacing of floating-point times near t, within a factor of two."""
    return jnp.finfo(t.dtype).eps * jnp.abs(t)


class StepControl(Observing, diffrax.AbstractStepSizeController):
    """Elementary error-per-step control: h <- 0.75 h (tolerance / error)^(1/p).

    Attributes:
      first: () length of the first step.
      ts: (s,) requested times in the direction of integration; (0,) for none.
      watch: the observer of the steps, if any.
      limit: see `Observing`.
      look: see `Observing`.
      max_step: see `Observing`.
    """

    first: Array
    ts: Array
    watch: Watch | None = None
    limit: tuple[Array, Array] | None = None
    look: Lookahead | None = None
    max_step: Array | None = None
    norm: ClassVar[Callable] = staticmethod(lambda y: jnp.max(jnp.sqrt(_mean_square(y))))

    def seen(self, state) -> Seen:
        """The samples, the memory of the watch and the number of steps, from the final state."""
        return state

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        del terms, dt0, args, func, error_order
        # If shorter than the spacing of times, it would not be a step, nor would any after it.
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
            factor = SAFETY * rough_power(jnp.maximum(error, 1e-30), -1.0 / error_order)
            h_next = h * jnp.clip(factor, _SHRINK, jnp.where(tried.fine, _GROW, SAFETY))
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
    """() length of the first step, if its error is about a power of its length in times.

    The time is that of the motion, or that of the fastest change of an entry by its size, whichever
    is shorter.

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


class FixedSteps(Observing, diffrax.AbstractStepSizeController):
    """n equal steps; the time of each is a multiple of the step, not a sum of steps.

    Attributes:
      n: () number of steps.
      ts: (s,) requested times in the direction of integration; (0,) for none.
      watch: the observer of the steps, if any.
      limit: see `Observing`.
      look: see `Observing`.
      max_step: see `Observing`.
    """

    n: Array
    ts: Array
    watch: Watch | None = None
    limit: tuple[Array, Array] | None = None
    look: Lookahead | None = None
    max_step: Array | None = None

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
