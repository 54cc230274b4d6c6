"""The loop over the steps of a motion: the only caller of ``diffrax.diffeqsolve``.

`march` takes a smooth field from a start to an end, with samples and an observer of the steps. It
leaves derivatives to `flow`, conditions of a rate to `pieces`, and events to `event_search`.
"""

import functools
from typing import Annotated, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn.integrate.lookahead import look_from_start
from jaxdyn.integrate.observing import Watch
from jaxdyn.integrate.step_control import FixedSteps, StepControl, first_step, steps_of
from jaxdyn.solvers import Method
from jaxdyn.solvers.formulas.simplified import simplify
from jaxdyn.solvers.method import operations
from jaxdyn.solvers.sizes import AtStart
from jaxdyn.solvers.stepper import Stepper, Stepping, is_stiff
from jaxdyn.status import Status
from jaxdyn.system import Record

#: Operations of a rate above which a loop over stages runs as fast as unrolled stages and
#: compiles ten times sooner (measured: three bodies 80, double pendulum 590).
UNROLLED_BELOW = 200


class SolveResult(Record):
    """States along a trajectory.

    Attributes:
      y1: (k,) state at the end; NaN if it was not reached.
      ys: (s, k) states at the wanted times; NaN where not reached.
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
    """What a motion has shown before a piece of it.

    Attributes:
      sizes: (k, ...) its sizes, see `solvers.sizes`.
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
):
    """States of a smooth motion, the final memory of a watch, its sizes; without derivatives.

    Args:
      field: see `flow`; its conditions are evaluated as they stand.
      y0: (k, ...) start.
      t0: () start time.
      t1: () end time, before or after t0.
      ts: (s,) requested times, those before t0 among them, which are not reached.
      limits: see `flow`.
      method: the method.
      watch: an observer of the steps, which may stop the run.
      before: what the motion that this is a piece of has shown before.
    """
    direction = jnp.where(t1 > t0, 1.0, -1.0)  # as in diffrax, also for t1 = t0
    rate = _by_formulas if method.evaluates else _rate
    wide = watch is not None or y0.ndim > 1
    if wide or operations(lambda t, y: rate(t, y, field), t0, y0) > UNROLLED_BELOW:
        method = method.in_loops(1)
    start, control, h = _control(field, y0, t0, t1, ts, limits, method, watch, before)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        Stepper(method, limits.tolerance, start.sizes if method.adaptive else None, h),
        t0,
        t1 + (t1 - t0),  # never reached: the step control ends the run
        None,
        y0,
        args=field,
        stepsize_controller=control,
        saveat=diffrax.SaveAt(t1=True, controller_state=True, solver_state=True),
        max_steps=None,  # counted by the controller: diffrax compiles its limit in
        adjoint=Stepping(),
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
    open_ = jax.lax.map(lambda end: field.undetermined(*end), ends)
    if open_ is not None:
        status = jnp.where(open_.any(), int(Status.SINGULAR), status)
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
    start, look = look_from_start(field, t0, y0, t1, tolerance)
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
