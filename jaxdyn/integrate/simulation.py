"""Simulate a scene: from a start and a span to states at requested times.

`simulate` checks its arguments on the host, chooses the method that suits the effects of the
scene, compiles once for each kind of scene (new numbers never recompile) and returns a
`Trajectory`.
"""

import functools
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, check_first
from jaxdyn._records import notes_on
from jaxdyn.integrate import errors
from jaxdyn.integrate.adjoint import adjoint_flow
from jaxdyn.integrate.errors import Estimate
from jaxdyn.integrate.fixed import FixedField
from jaxdyn.integrate.flow import SolveResult, flow, rate_in, run_or_switch
from jaxdyn.integrate.march import Limits
from jaxdyn.integrate.pieces import first_branch
from jaxdyn.integrate.spans import MAX_STEPS as MAX_STEPS
from jaxdyn.integrate.spans import RTOL as RTOL
from jaxdyn.integrate.spans import (
    Share,
    SolverOptions,
    host_floats,
    limits,
    padding,
    sampled_span,
)
from jaxdyn.integrate.trajectory import Trajectory, raise_unless_ok
from jaxdyn.plan.branch import Branch
from jaxdyn.scene import Scene
from jaxdyn.solvers import RADAU9, Method, Solver
from jaxdyn.solvers.choice import check_method, within_trace
from jaxdyn.solvers.perturbed import QUIET, Noise, RoundedField

#: Start (), end () and times (s,) of samples.
Span = tuple[Any, Any, Any]
_LOOSE_RTOL = 1e-6


@check_first
def simulate(
    scene: Scene,
    t1=None,
    *,
    t0=0.0,
    samples=200,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | None = None,
    dt: float | None = None,
    digits: float | None = None,
    max_steps: int = MAX_STEPS,
    max_step=None,
    breaks=(),
    throw: bool = True,
) -> Trajectory:
    """The motion of a scene from its start y0, sampled over [t0, t1].

    Args:
      scene: system, effects, start.
      t1: () end time [s], after or before t0; the scene's own span by default.
      t0: () start time [s].
      samples: number of times, evenly spaced from t0 to t1, or an array of times (s,) in the
        order of integration.
      rtol: relative tolerance of one step.
      atol: absolute tolerance of one step, in the units of the state; by default a quarter of
        rtol times the largest size so far of the entries of its kind, whatever the units
        (`scales.Groups`).
      solver: one of `jaxdyn.solvers`, or a Runge-Kutta solver of diffrax, such as
        ``diffrax.Tsit5()``. The default is mostly a Taylor series where the rate is a short
        formula, else the extrapolated leapfrog or the Nystrom pair of order 12 where no force
        depends on velocity, and otherwise the best Runge-Kutta pair; see `solvers.default_solver`.
        Where stability limits a thousand of its steps, the motion starts again with the implicit
        `RADAU9`, and `Trajectory.warning` says so.
      dt: longest step [s] of a solver of fixed step, which does not use rtol and atol; the
        span is divided into equal steps.
      digits: correct digits requested at all samples, instead of rtol and atol: the tolerance
        is found, and the estimate behind it is `Trajectory.error`. Digits that rounding may
        spoil are not promised. Takes 5 to 12 times as long as one solve, up to 20 times where
        rounding leaves about as many digits, with the same compile time; host only.
      max_steps: largest number of steps.
      max_step: () longest step [s], for parts of a rate that cannot be read, such as a callback.
      breaks: (b,) times [s] at which the rate is known to be rough: steps end there.
      throw: raise on any status but OK; with False check `Trajectory.status`.
    Returns:
      The sampled motion.
    Raises:
      ValueError: `t0` or `t1` is not finite, a tolerance, `dt`, `digits`, `samples` or
        `max_steps` is out of range, or the solver does not suit the scene.
      IntegrationError: the end was not reached (``throw=True``, outside of traces).
    Limits: conditions of the rate (``where``, ``sign``, ``max``, ``floor``, tables) end steps where
      they change, and what depends on time alone is seen down to a millionth of the span. What the
      rate does in between as a function of the state alone, such as a wind in a thin layer, is seen
      by the error of a step only, and what cannot be read is not seen: `Trajectory.warning` names
      it. Steps of fixed length (``dt``) end where they end. Inside jit, grad and vmap the default
      does not switch to an implicit method, since both would be compiled, and under vmap run. A
      stiff scene takes very many steps there, and `Trajectory.warning` says so; pass
      ``solver=solvers.RADAU9``.
    Example:
      >>> from jaxdyn import scenes, simulate
      >>> motion = simulate(scenes.cannonball(drag=0.0), 1.0)
      >>> motion.ok
      True
    """
    t0, t1, ts = sampled_span(scene, t1, t0, samples, rtol if digits is None else 0.0)
    options = SolverOptions(rtol, atol, solver, max_steps, max_step, breaks)
    error = None
    if digits is None:
        run_limits = limits(options, dt)  # checked first, since the choice of a method uses them
        method = check_method(scene, solver, dt, rtol=rtol)
        result, switched = _solve(scene, (t0, t1, ts), run_limits, method, default=solver is None)
    else:
        if dt is not None or atol is not None or rtol != RTOL:
            remedy = "The tolerances are found from digits."
            raise _checks.fail("digits", "no rtol, atol or dt with it", "one", remedy)
        # One method serves all tolerances that are tried.
        method = check_method(scene, solver, rtol=errors.FINEST)
        result, error, switched = _to_digits(scene, (t0, t1, ts), options, method, digits, throw)
    if throw:
        raise_unless_ok(result.status, scene)
    return Trajectory(
        scene=scene,
        ts=ts,
        ys=result.ys,
        steps=result.steps,
        rejected=result.rejected,
        status=result.status,
        stiff=result.stiff,
        switched=switched,
        error=error,
        dt=None if dt is None else (t1 - t0) / jnp.maximum(result.steps, 1),
        method=None if dt is None else method,
    )


def _to_digits(
    scene: Scene, span: Span, options: SolverOptions, method: Method, digits: float, refuse: bool
) -> tuple[SolveResult, Estimate, bool]:
    """The result of `errors.solve_to_digits` by one method, and whether that is `RADAU9`."""

    def run(scene: Scene, tolerance, noise: Noise = QUIET) -> SolveResult:
        rtol, atol = tolerance
        run_limits = limits(options._replace(rtol=rtol, atol=Share(atol)))
        return _solve(scene, span, run_limits, method, default=default, noise=noise)[0]

    # At a loose tolerance stability is most likely to limit the steps.
    loose, default = limits(options._replace(rtol=_LOOSE_RTOL)), options.solver is None
    _, switched = _solve(scene, span, loose, method, default=default, noise=QUIET)
    if switched:
        method, default = RADAU9, False
    return *errors.solve_to_digits(run, scene, span[-1], digits, method.name, refuse), switched


@check_first
def solve(
    scene: Scene,
    t1,
    *,
    t0=0.0,
    ts=(),
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | None = None,
    dt: float | None = None,
    max_steps: int = MAX_STEPS,
    max_step=None,
    breaks=(),
    fixed: bool = False,
    adjoint: bool | Literal["steps"] = False,
    noise: Noise | None = None,
) -> SolveResult:
    """The motion as `simulate` finds it, without its checks and exceptions: for other programs.

    Compiled for each kind of scene and method, also where grad or vmap call it.

    Args:
      scene: system, effects, start; only numbers that its functions captured are checked.
      t1: () end time [s], after or before t0.
      t0: () start time [s].
      ts: (s,) requested times [s] between t0 and t1, in the order of integration.
      rtol: relative tolerance of one step.
      atol: absolute tolerance of one step, in the units of the state; by default a quarter of
        rtol times the largest size so far of the entries of its kind, whatever the units
        (`scales.Groups`).
      solver: see `simulate`.
      dt: see `simulate`.
      max_steps: largest number of steps.
      max_step: see `simulate`.
      breaks: see `simulate`.
      fixed: make the scene's numbers, except start and span, constants of the program: faster, but
        new ones recompile, and there are no derivatives with respect to them.
      adjoint: derivatives by the adjoint equations, backwards in time. One loss costs a few solves,
        whether by one number or by thousands. Reverse mode and first derivatives only. NaN for
        stiff motions, see below. With "steps" the steps of the motion are differentiated instead
        (discretise, then optimise), where the rate has no conditions: faster for many numbers, also
        for stiff motions, but no tolerance controls the error of the gradient.
      noise: random perturbation of each step, to measure the effect of rounding; see
        `solvers.perturbed`.
    Returns:
      The state at t1, those at ts, and a status; NaN where not reached.
    Raises:
      ValueError: a tolerance, `dt` or `max_steps` is out of range, or the solver does not suit.
    Limits: derivatives are those of the computed motion, and lose as many digits as it does, and a
      few more where it is sensitive. At rtol 1e-10 the derivative of three bodies by G is right to
      11 digits after one period and to 9 after ten, that of the Lorenz system by rho to 10 digits
      at t = 10 and to 6 at t = 20, where the state has 8; they gain a digit with each power of ten
      of rtol. Central differences are worse: 7 to 10 digits, with the best step. (All were compared
      with variational equations in 60 digits.) With `adjoint` they are NaN for stiff motions, whose
      fast parts grow backwards in time; leave it out there. Under vmap all samples are copied at
      each step: for hundreds of them use `jax.lax.map`.
    """
    _checks.float64(rtol)
    options = SolverOptions(rtol, atol, solver, max_steps, max_step, breaks)
    run_limits = limits(options, dt)
    method = check_method(scene, solver, dt, rtol=rtol)
    _checks.flag("fixed", fixed)
    if not (isinstance(adjoint, bool) or adjoint == "steps"):
        raise _checks.fail("adjoint", 'True, False or "steps"', repr(adjoint))
    extras = {"default": solver is None, "fixed": fixed, "adjoint": adjoint, "noise": noise}
    times = {"t0": (t0, ()), "t1": (t1, ()), "ts": (ts, (None,))}
    # If ts were a matrix, its first column would be taken silently.
    span = tuple(host_floats(x, name) for name, (x, _) in times.items())
    for given, (name, (_, shape)) in zip(span, times.items(), strict=True):
        _checks.check_shape(name, given.shape, shape)
    return _solve(scene, span, run_limits, method, **extras)[0]


def solve_to_end(scene: Scene, t1, *, rtol: float, solver: Solver | None = None) -> SolveResult:
    """The result of `solve` for a motion that an event ends at t1.

    Where a force jumps just then, as that of friction does where a block stops, derivatives are
    those of the motion that arrives; with `solve` they are those of the motion that goes on.

    Args:
      scene: see `solve`.
      t1: see `solve`.
      rtol: see `solve`.
      solver: see `solve`.
    """
    run_limits = limits(SolverOptions(rtol, None, solver, MAX_STEPS, None, ()))
    method = check_method(scene, solver, rtol=rtol)
    times = as_float(0.0), as_float(t1), np.zeros(0)
    return _solve(scene, times, run_limits, method, default=solver is None, passes=False)[0]


def branch_from(scene: Scene, t, y: Array, t1, *, rtol) -> Branch | None:
    """The branch in which a motion goes on from a state; None where its rate has no conditions.

    Where a force jumps there, as that of friction does where a speed changes its sign, the state
    is on its surface only to rounding, and `Scene.rate` is that of either side, or of neither.

    Args:
      scene: system and effects; its start is not used.
      t: () time.
      y: (k,) the state.
      t1: () the end of the motion, which gives its direction in time and its span.
      rtol: see `solve`.
    """
    run_limits = limits(SolverOptions(rtol, None, None, MAX_STEPS, None, ()))
    method = within_trace(scene, check_method(scene, None, rtol=rtol))
    return first_branch(scene.field, y, as_float(t), as_float(t1), run_limits, method=method)


@eqx.filter_jit
def rate_from(scene: Scene, y: Array, t1, *, rtol) -> Array:
    """(k,) the rate with which a motion goes on from a state at time 0; see `branch_from`."""
    t0 = jnp.zeros(())
    return rate_in(branch_from(scene, t0, y, t1, rtol=rtol), scene.field, t0, y)


def _solve(
    scene: Scene,
    span: Span,
    run_limits: Limits,
    method: Method,
    *,
    default: bool,
    fixed: bool = False,
    adjoint: bool | Literal["steps"] = False,
    noise: Noise | None = None,
    passes: bool = True,
) -> tuple[SolveResult, bool]:
    """The result of `solve` by a method, and whether `RADAU9` took over.

    It may do so where the method is the default and nothing is traced. For `passes` see
    `pieces.run_pieces`.
    """
    y0, n = as_float(scene.y0), len(span[-1])
    field = FixedField(scene.field) if fixed else scene.field
    field = field if noise is None else RoundedField(field, noise)
    # To look for tracers among the scene's numbers takes half as long as an empty program.
    numbers = () if noise is None and notes_on(scene) is not None else (field,)
    traced = any(map(_checks.is_traced, (*numbers, y0, *span, *run_limits)))
    t0, t1, ts = (host_floats(x, "time") for x in span)
    if traced:
        method = within_trace(scene, method) if default else method
    elif n and not adjoint:
        # NaN is a time that is never reached. There is no padding in traces: derivatives would see
        # it, and traces recompile anyway.
        ts = np.append(ts, np.full(padding(n, y0.size), np.nan))
    traced_flow = functools.partial(flow, passes=passes)
    reverse_flow = functools.partial(_reverse_flow, through_steps=adjoint == "steps")
    march = reverse_flow if adjoint else traced_flow if traced else _compiled_flow
    run = functools.partial(march, field, y0, t0, t1, ts)
    out, switched = run_or_switch(run, run_limits, method, default=default and not traced)
    if not switched and len(ts) == n:
        return out, False
    # A slice in JAX, `as_float`, and `asarray` without a type would compile for each length.
    ys = jnp.asarray(np.asarray(out.ys)[:n], float)
    stiff = jnp.asarray(True) if switched else out.stiff
    result = SolveResult(
        y1=out.y1, ys=ys, steps=out.steps, rejected=out.rejected, status=out.status, stiff=stiff
    )
    return result, switched


@functools.partial(jax.jit, static_argnames="method")
def _compiled_flow(*args, method: Method) -> SolveResult:
    return flow(*args, method=method)


def _reverse_flow(*args, method: Method, through_steps: bool) -> SolveResult:
    """The result of `_compiled_adjoint_flow`; raises ValueError in forward mode.

    JAX finds out that it is forward mode when it meets the tangents, and names `jax.custom_vjp`.
    """
    try:
        return _compiled_adjoint_flow(*args, method=method, through_steps=through_steps)
    except (TypeError, NotImplementedError) as error:
        if not any(name in str(error) for name in ("custom_vjp", "custom_lin")):
            raise
        wanted, got = "reverse mode, as of jax.grad or jax.jacrev", "forward mode, as of jax.jacfwd"
        raise _checks.fail("adjoint", wanted, got, "Leave adjoint= out.") from error


@functools.partial(jax.jit, static_argnames=("method", "through_steps"))
def _compiled_adjoint_flow(*args, method: Method, through_steps: bool) -> SolveResult:
    return adjoint_flow(*args, method=method, through_steps=through_steps)
