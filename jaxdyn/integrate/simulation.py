"""Simulate a scene: from a start and a span to states at requested times.

`simulate` checks its arguments on the host, chooses the method that suits the effects of the
scene, compiles once for each kind of scene (new numbers never recompile) and returns a
`Trajectory`.
"""

import functools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import _checks
from jaxdyn._floats import as_float
from jaxdyn._notes import notes_on
from jaxdyn.integrate import error_estimate
from jaxdyn.integrate.adjoint import adjoint_flow
from jaxdyn.integrate.fixed import FixedField
from jaxdyn.integrate.flow import Settings, SolveResult, flow
from jaxdyn.integrate.spans import MAX_STEPS as MAX_STEPS
from jaxdyn.integrate.spans import RTOL as RTOL
from jaxdyn.integrate.spans import (
    SolverOptions,
    filling,
    host_floats,
    limits,
    no_times,
    quickly_passed,
    sampled_span,
)
from jaxdyn.integrate.trajectory import Trajectory, raise_unless_ok
from jaxdyn.scene import Scene
from jaxdyn.solvers import RADAU9, Solver
from jaxdyn.solvers.choice import checked_method, chosen_method, method_of
from jaxdyn.solvers.perturbed import QUIET, Noise, RoundedField


def simulate(
    scene: Scene,
    t1=None,
    *,
    t0=0.0,
    samples=200,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | str | None = None,
    dt: float | None = None,
    digits: float | None = None,
    max_steps: int = MAX_STEPS,
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
      atol: absolute tolerance of one step, in the units of the state; rtol by default.
      solver: one of `jaxdyn.solvers`, or an explicit Runge-Kutta solver of diffrax, such as
        ``diffrax.Tsit5()``; by default mostly a Taylor series where the rate is a short formula,
        else the extrapolated leapfrog or the Nystrom pair of order 12 where no force depends on
        velocity, and the best Runge-Kutta pair; see `solvers.default_solver`. "auto" takes the
        default and, if the scene turns out to be stiff, restarts with an implicit method.
      dt: longest step [s] of a solver of fixed step, which does not use rtol and atol; the
        span is divided into equal steps.
      digits: correct digits requested at all samples, instead of rtol and atol: the tolerance
        is found, and the estimate behind it is `Trajectory.error`. Digits that rounding may
        spoil are not promised. Takes 5 to 12 times as long as one solve, up to 20 times where
        rounding leaves about as many digits, with the same compile time; host only.
      max_steps: largest number of steps.
      throw: raise on any status but OK; with False look at `Trajectory.status`.
    Returns:
      The sampled motion.
    Raises:
      ValueError: `t0` or `t1` is not finite, a tolerance, `dt`, `digits`, `samples` or
        `max_steps` is out of range, or the solver does not suit the scene.
      IntegrationError: the end was not reached (``throw=True``, outside of traces).
    Limits: by default explicit methods; a stiff scene takes very many steps, and
      `Trajectory.warning` says so.
    Example:
      >>> from jaxdyn import scenes, simulate
      >>> motion = simulate(scenes.cannonball(drag=0.0), 1.0)
      >>> motion.ok
      True
    """
    _checks.float64()
    t0, t1, ts = sampled_span(scene, t1, t0, samples)

    # With digits all runs share one compiled program.
    def run(scene, tolerance, noise=None if digits is None else QUIET):
        rtol, atol = tolerance
        options = SolverOptions(rtol=rtol, atol=atol, solver=solver, max_steps=max_steps)
        return solve(scene, t1, t0=t0, ts=ts, dt=dt, noise=noise, **options._asdict())

    error = None
    if digits is None:
        result = run(scene, (rtol, atol))
    else:
        if dt is not None or atol is not None or rtol != RTOL:
            remedy = "The tolerances are found from digits."
            raise _checks.fail("digits", "no rtol, atol or dt with it", "one", remedy)
        if not isinstance(solver, str):
            # One for all tolerances that are tried.
            solver = chosen_method(scene, solver, rtol=error_estimate.FINEST)
        name = solver if isinstance(solver, str) else solver.name
        result, error = error_estimate.reached(run, scene, ts, digits, name, throw)
    if throw:
        raise_unless_ok(result.status, scene)
    return Trajectory(
        scene=scene,
        ts=ts,
        ys=result.ys,
        steps=result.steps,
        rejected=result.rejected,
        status=result.status,
        # No warning where an implicit method took over.
        stiff=False if solver == "auto" else result.stiff,
        error=error,
        dt=None if dt is None else (t1 - t0) / jnp.maximum(result.steps, 1),
        method=None if dt is None else method_of(solver),
    )


def solve(
    scene: Scene,
    t1,
    *,
    t0=0.0,
    ts=(),
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | str | None = None,
    dt: float | None = None,
    max_steps: int = MAX_STEPS,
    fixed: bool = False,
    adjoint: bool = False,
    noise: Noise | None = None,
) -> SolveResult:
    """`simulate` without samples, checks and exceptions: for use inside other programs.

    Compiled for each kind of scene and method, also where grad or vmap call it.

    Args:
      scene: system, effects, start; not checked.
      t1: () end time [s], after or before t0.
      t0: () start time [s].
      ts: (s,) requested times [s] between t0 and t1, in the order of integration.
      rtol: relative tolerance of one step.
      atol: absolute tolerance of one step; rtol by default.
      solver: see `simulate`.
      dt: see `simulate`.
      max_steps: largest number of steps.
      fixed: make the scene's numbers, except start and span, constants of the program: faster, but
        new ones recompile, and there are no derivatives with respect to them.
      adjoint: derivatives by the adjoint equations, backwards in time: for one loss the cost of a
        few solves, for one number or thousands. Reverse mode and first derivatives only.
      noise: random perturbation of each step, to measure the effect of rounding; see
        `solvers.perturbed`.
    Returns:
      The state at t1, those at ts, and a status; NaN where not reached.
    Raises:
      ValueError: a tolerance, `dt` or `max_steps` is out of range, or the solver does not suit.
    Limits: derivatives are those of the computed motion, and lose as many digits, and a few more
      where it is sensitive. At rtol 1e-10 the derivative of three bodies by G is right to 11
      digits after one period and to 9 after ten, that of the Lorenz system by rho to 10 digits at
      t = 10 and to 6 at t = 20, where the state has 8; they gain a digit with each power of ten
      of rtol. Central differences are worse: 7 to 10 digits, with the best step. (All compared
      with variational equations in 60 digits.)
    """
    auto = isinstance(solver, str) and _checks.choice("solver", solver, ("auto",)) == "auto"
    held_to = limits(SolverOptions(rtol=rtol, atol=atol, max_steps=max_steps), dt)
    settings = Settings(checked_method(scene, None if auto else solver, dt, rtol=rtol))
    y0, n = as_float(scene.y0), len(ts)
    field = FixedField(scene.field) if fixed else scene.field
    field = field if noise is None else RoundedField(field, noise)
    # A search through the scene's numbers takes half as long as an empty program.
    numbers = () if noise is None and notes_on(scene) is not None else (field,)
    traced = any(map(_checks.is_traced, (*numbers, y0, t0, t1, ts, *held_to)))
    if traced:
        t0, t1, ts = (host_floats(x) for x in (t0, t1, ts))
    else:
        t0, t1 = quickly_passed(t0), quickly_passed(t1)
        ts = np.asarray(ts, float) if n else no_times()
        if n and not adjoint:
            # NaN is never reached; derivatives would see it, and traces recompile anyway.
            given, ts = ts, np.full(n + filling(n, y0.size), np.nan)
            ts[:n] = given
    march = _compiled_adjoint if adjoint else flow if traced else _compiled
    run = functools.partial(march, field, y0, t0, t1, ts, held_to)
    out = _auto(run, settings, traced) if auto else run(settings=settings)
    if len(ts) == n:
        return out
    # A slice in JAX, `as_float`, and `asarray` without a type would compile for each number.
    ys = jnp.asarray(np.asarray(out.ys)[:n], float)
    return SolveResult(
        y1=out.y1, ys=ys, steps=out.steps, rejected=out.rejected, status=out.status, stiff=out.stiff
    )


def _auto(run: Callable[..., SolveResult], settings: Settings, traced: bool) -> SolveResult:
    """A run that restarts with an implicit method if it turns out to be stiff."""
    if traced:
        return run(settings=settings._replace(stiff=RADAU9))
    # On the host the implicit method is compiled, which doubles the time, only if needed.
    first = run(settings=settings._replace(stops=True))
    if not first.stiff:
        return first
    done = run(settings=settings._replace(method=RADAU9))
    return eqx.tree_at(lambda flow: flow.stiff, done, first.stiff)


@functools.partial(jax.jit, static_argnames="settings")
def _compiled(*args, settings: Settings) -> SolveResult:
    return flow(*args, settings=settings)


@functools.partial(jax.jit, static_argnames="settings")
def _compiled_adjoint(*args, settings: Settings) -> SolveResult:
    return adjoint_flow(*args, settings=settings)
