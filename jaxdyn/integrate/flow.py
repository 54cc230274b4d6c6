"""The map from a start to the states at later times, and its derivatives.

`march` is the only caller of ``diffrax.diffeqsolve``. `flow` is built on it and differentiable
any number of times, in forward and reverse mode, under jit and vmap, in the start, the times
and every number of the scene. Its derivative is not taken through the stepping loop (that
would differentiate the choice of steps, compile slowly, and allow only one mode) but by the
variational equations (`Variational`), integrated together with the state, the tangents in the
error norm. The result is a matrix; forward and reverse mode both multiply by it. So a gradient
costs about as much as a Jacobian: right for the tens of numbers of a mechanics scene, not for
thousands (a neural force).
"""

import functools
from typing import Annotated

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn._numerics import in_one_kernel
from jaxdyn.integrate.observing import Watch
from jaxdyn.integrate.step_control import FixedSteps, Limits, StepControl, steps_of
from jaxdyn.integrate.variational import Variational, tangent_columns
from jaxdyn.solvers import Method
from jaxdyn.solvers.formulas.simplified import simplified
from jaxdyn.solvers.method import operations
from jaxdyn.solvers.stepper import Stepper, is_stiff
from jaxdyn.solvers.stepping import Stepping
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


# Compiled within the rule of derivatives, not around it, as is the rule: a derivative then traces
# no plain solve besides its own, and several solves of a kind in one program are traced once.
@eqx.filter_custom_jvp
@functools.partial(jax.jit, static_argnames="method")
def flow(field, y0, t0, t1, ts, limits: Limits, *, method: Method) -> SolveResult:
    """States at t1 and at the times ts of the motion that starts at (t0, y0).

    Args:
      field: has ``rate``, ``project`` and ``undetermined`` of (t, y); a pytree of its numbers,
        e.g. `Scene.field`.
      y0: (k,) start; (k, columns) for a `Variational` field.
      t0: () start time.
      t1: () end time, before or after t0.
      ts: (s,) times between t0 and t1 in the order they are passed.
      limits: tolerances or step length, and the maximum numbers of steps.
      method: for plain solves; variational equations are solved by its `for_tangents`.
    Limits: derivatives with respect to the tolerance are zero by definition.
    """
    run = functools.partial(_marched, method=method)
    # Some of these are known only at run time; the tolerance is often a constant.
    unknown = jnp.isfinite(y0.ravel()[0] + t0 + t1 + limits.tolerance[0])
    return in_one_kernel(run, (field, y0, t0, t1, ts, limits), unknown=unknown)


def _marched(*args, method: Method) -> SolveResult:
    return march(*args, method=method, watch=None)[0]


def march(field, y0, t0, t1, ts, limits, *, method: Method, watch: Watch | None):
    """`flow` without derivatives, and the final memory of a watch."""
    tolerance, most = limits.tolerance, (limits.max_steps, t1)
    direction = jnp.where(t1 > t0, 1.0, -1.0)  # as in diffrax, also for t1 = t0
    rate = _by_formulas if method.evaluates else _rate
    wide = watch is not None or y0.ndim > 1
    if wide or operations(lambda t, y: rate(t, y, field), t0, y0) > UNROLLED_BELOW:
        method = method.in_loops(1)
    # One program for both directions of time; diffrax negates ts with the rest.
    if method.adaptive:
        rtol, atol = tolerance[0], tolerance[1]
        h, control = None, StepControl(rtol=rtol, atol=atol, ts=ts, watch=watch, limit=most)
    else:
        n = steps_of(tolerance[0], t0, t1)
        h, control = (t1 - t0) / n, FixedSteps(n=n, ts=ts, watch=watch, limit=most)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        Stepper(method, tolerance, h),
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
    # The logarithm is finite for positive tolerances only.
    given = (y0, field.rate(t0, y0), t0, t1, jnp.log(tolerance))
    status = _status(solution.result, given)
    ts_end, ys_end, state = solution.ts, solution.ys, solution.solver_state
    assert ts_end is not None  # all three are saved, see above
    assert ys_end is not None
    assert state is not None
    count = state[1]
    limited = (status == Status.STEP_LIMIT) & (count >= limits.max_steps[1].astype(float))
    status = jnp.where(limited, int(Status.STIFF), status)
    # Increasing; beyond t1 where the step control has ended the run there.
    last = jnp.minimum(direction * ts_end[-1], direction * t1)
    ends = jnp.stack([t0, direction * last]), jnp.stack([y0, ys_end[-1]])
    open_ = jax.lax.map(lambda end: field.undetermined(*end), ends)
    if open_ is not None:
        status = jnp.where(open_.any(), int(Status.SINGULAR), status)
    y1 = jnp.where(status == Status.OK, ys_end[-1], jnp.nan)
    seen = control.seen(solution.controller_state)
    # Not those taken within a step that failed.
    reached = (direction * ts <= last).reshape(-1, *[1] * y0.ndim)
    steps = solution.stats["num_accepted_steps"]
    result = SolveResult(
        y1=y1,
        ys=jnp.where(reached, seen.samples.ys, jnp.nan),
        steps=steps,
        rejected=seen.steps - steps,  # not all others: steps to samples are neither
        status=status,
        stiff=is_stiff(count),
    )
    return result, seen.watch


@flow.def_jvp
@functools.partial(jax.jit, static_argnames="method")
def _flow_jvp(primals, tangents, *, method):
    field, y0, t0, t1, ts, limits = primals
    d_field, d_y0, d_t0, d_t1, d_ts, _ = tangents
    f0 = field.rate(t0, y0)
    columns, directions, multiply = tangent_columns(field, y0, f0, d_field, d_y0, d_t0)
    if columns.shape[-1]:
        start = jnp.concatenate([y0[..., None], columns], axis=-1)
        method = method.for_tangents
        out = flow(Variational(field, directions), start, t0, t1, ts, limits, method=method)
        y1, ys = out.y1[..., 0], out.ys[..., 0]
        d_y1, d_ys = multiply(out.y1[..., 1:]), multiply(out.ys[..., 1:])
    else:
        out = flow(field, y0, t0, t1, ts, limits, method=method)
        y1, ys, d_y1, d_ys = out.y1, out.ys, jnp.zeros_like(y0), jnp.zeros_like(out.ys)
    if d_t1 is not None:
        d_y1 = d_y1 + field.rate(t1, y1) * d_t1
    if d_ts is not None:
        rates = jax.vmap(field.rate)(ts, ys)
        d_ys = d_ys + rates * d_ts.reshape(-1, *[1] * y0.ndim)
    result = SolveResult(
        y1=y1, ys=ys, steps=out.steps, rejected=out.rejected, status=out.status, stiff=out.stiff
    )
    return result, SolveResult(y1=d_y1, ys=d_ys, steps=None, rejected=None, status=None, stiff=None)


# Traced once for all that a step, its preparation and its checks make of a rate.
@functools.partial(jax.jit, inline=True)
def _rate(t, y, field):
    return field.rate(t, y)


@functools.partial(jax.jit, inline=True)
def _by_formulas(t, y, field):
    return simplified(field.rate)(t, y)


def _status(result, given: tuple[Array, ...]) -> Array:
    meanings = (
        (diffrax.RESULTS.max_steps_reached, Status.STEP_LIMIT),
        (diffrax.RESULTS.dt_min_reached, Status.STEP_COLLAPSED),
        (diffrax.RESULTS.nonlinear_divergence, Status.STEP_TOO_LONG),
    )
    status = jnp.asarray(int(Status.OK))
    for code, meaning in meanings:
        status = jnp.where(result == code, int(meaning), status)
    # One test for all: each costs XLA on CPU a quarter of a microsecond of memory management.
    finite = jnp.isfinite(jnp.concatenate([x.ravel() for x in given])).all()
    return jnp.where(finite, status, int(Status.NOT_FINITE))
