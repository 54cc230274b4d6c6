"""Simulate a scene: from a start and a span to states at wanted times.

`simulate` checks what it was given on the host, chooses the method from what the effects of
the scene call for, compiles once for each kind of scene (new numbers never recompile) and
returns a `Trajectory`.
"""

import functools
from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.integrate import ladder
from jaxdyn.integrate.adjoint import adjoint_flow
from jaxdyn.integrate.fixed import FixedField
from jaxdyn.integrate.flow import Flow, Settings, flow
from jaxdyn.integrate.spans import floats, limits, times
from jaxdyn.integrate.step_control import Limits
from jaxdyn.scene import Scene, checked
from jaxdyn.solvers import NYSTROM12, RADAU9, VERNER9, Method
from jaxdyn.solvers.rounding import QUIET, Noise, RoundedField
from jaxdyn.status import IntegrationError, Status

_STIFF = (
    "The scene is stiff: stability, not accuracy, ruled the steps of the explicit method. "
    "Pass solver='auto' or solvers.RADAU9."
)
_TOO_LONG = (
    "Steps of fixed length are too long for parts of the motion: adaptive ones lead elsewhere. "
    "Make dt smaller, or leave the solver out to have steps adapt."
)
_ELSEWHERE = 0.05  # of the way of a step: more is no step of this motion
_CHECK_RTOL, _CHECK_STEPS = 1e-6, 10_000  # of the adaptive steps that tell
MAX_STEPS = 1_000_000
RTOL = 1e-10
T = TypeVar("T")


class Trajectory(eqx.Module):
    """A motion of a scene at sampled times, or a batch of them.

    ``jax.vmap`` of a function that simulates returns a batch: every array, those of the scene
    too, has the axes of the batch in front of its own.

    Attributes:
      scene: what moved.
      ts: (s,) sample times [s].
      ys: (s, k) states there; NaN where the run did not get to.
      steps: () accepted steps.
      rejected: () rejected steps.
      status: () `Status` code.
      stiff: () whether stability, not accuracy, ruled the steps, which were those of an explicit
        method to the end.
      error: how accurate it is and how that is known, where ``digits`` were asked for.
      dt: () length of its steps with its sign, where it is fixed [s].
      method: what took steps of fixed length.
    """

    scene: Scene
    ts: Array
    ys: Array
    steps: Array
    rejected: Array
    status: Array
    stiff: Array | bool = False
    error: ladder.Estimate | None = None
    dt: Array | None = None
    method: Method | None = eqx.field(static=True, default=None)

    @property
    def ok(self) -> bool:
        """Whether the end was reached; host only."""
        return bool((self.status == Status.OK).all())

    @property
    def message(self) -> str:
        """What happened and what to do about it; host only."""
        return explained(self.status_code, self.scene)

    @property
    def status_code(self) -> Status:
        """The status as a `Status`, of a batch the worst; host only."""
        return Status(int(np.max(self.status)))

    @property
    def warning(self) -> str:
        """What is not wrong but could be better, and what to do; empty if nothing; host only."""
        parts = [_STIFF] if np.any(self.stiff) else []
        single = self.method is not None and self.ok and not self.lanes
        parts += [_TOO_LONG] if single and not np.all(_steps_agree(self)) else []
        parts += [self.error.shortfall] if self.error and self.error.shortfall else []
        return " ".join(parts)

    @property
    def lanes(self) -> tuple[int, ...]:
        """The axes of a batch, (b,) or more; () for one motion."""
        return np.shape(self.ts)[:-1]

    def one(self, *index: int) -> "Trajectory":
        """One motion of a batch."""
        if len(index) != len(self.lanes):
            wanted = f"{len(self.lanes)} numbers, one for each axis of the batch {self.lanes}"
            raise _checks.fail("index", wanted, index)
        return jax.tree.map(lambda x: x[index], self) if index else self

    def __getitem__(self, name: str) -> Array:
        """(s,) values of one labelled entry of the state, e.g. ``motion["x"]``.

        (b, s) of a batch.
        """
        system = self.one(*(0 for _ in self.lanes)).scene.system
        names = [label for label, _ in system.labels()]
        return self.ys[..., names.index(_checks.choice("label", name, names))]

    @property
    def r(self) -> Array:
        """(s, n, d) positions of the material points [m]; (b, s, n, d) of a batch."""
        return _positions(self)


def each_motion(function: Callable[..., T]) -> Callable[..., T]:
    """A function of a motion, made one of a batch too: results have the axes of the batch."""

    @functools.wraps(function)
    def of_each(motion: Trajectory, *args, **kwargs) -> T:
        if not motion.lanes:
            return function(motion, *args, **kwargs)
        return eqx.filter_vmap(lambda one: of_each(one, *args, **kwargs))(motion)

    return of_each


def single(motion: Trajectory) -> Trajectory:
    """The motion; raises ValueError for a batch, of which it takes one."""
    if motion.lanes:
        got = f"a batch of them, {motion.lanes}"
        remedy = "Take one of a batch by its number: batch.one(0)."
        raise _checks.fail("motion", "one motion", got, remedy)
    return motion


@each_motion
def _positions(motion: Trajectory) -> Array:
    return jax.vmap(lambda t, y: motion.scene.system.points(t, y).r)(motion.ts, motion.ys)


def simulate(
    scene: Scene,
    t1=None,
    *,
    t0=0.0,
    samples=200,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Method | str | None = None,
    dt: float | None = None,
    digits: float | None = None,
    max_steps: int = MAX_STEPS,
    throw: bool = True,
) -> Trajectory:
    """The motion of a scene from its start y0, sampled over [t0, t1].

    Args:
      scene: system, effects, start.
      t1: () end time [s], after or before t0; the scene's own span if left out.
      t0: () start time [s].
      samples: how many times, evenly spaced from t0 to t1, or an array of wanted times (s,)
        in the order they are passed.
      rtol: relative tolerance of one step.
      atol: absolute tolerance of one step, in the units of the state; rtol if left out.
      solver: one of `jaxdyn.solvers`; by default the Nystrom pair of order 12 where no force
        depends on velocity, else the best Runge-Kutta pair. "auto" takes the default and,
        where the scene turns out to be stiff, an implicit method from the start again.
      dt: longest step [s] of a solver of fixed step, which has no use for rtol and atol; the
        span is divided into equal steps.
      digits: how many should be right at all samples, instead of rtol and atol: the tolerance
        is found, and the estimate that it rests on is `Trajectory.error`. Digits that rounding
        may spoil are not promised. Takes 5 to 12 times as long as one solve, and no longer to
        compile; host only.
      max_steps: when to give up.
      throw: raise on any status but OK; with False look at `Trajectory.status`.
    Returns:
      The sampled motion.
    Raises:
      ValueError: numbers that make no sense.
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
    t0, t1, ts = times(checked(scene), t0, t1, samples)

    # With digits all runs are by one program, which is compiled once.
    def run(scene, tolerance, noise=None if digits is None else QUIET):
        rtol, atol = tolerance
        how = {"rtol": rtol, "atol": atol, "solver": solver, "dt": dt, "max_steps": max_steps}
        return solve(scene, t1, t0=t0, ts=ts, noise=noise, **how)

    error = None
    if digits is None:
        result = run(scene, (rtol, atol))
    else:
        if dt is not None or atol is not None or rtol != RTOL:
            remedy = "They find the tolerance themselves."
            raise _checks.fail("digits", "no rtol, atol or dt beside them", "one", remedy)
        result, error = ladder.reached(run, scene, ts, digits, _name(scene, solver), throw)
    if throw:
        raise_unless_ok(result.status, scene)
    # Where an implicit method took over there is nothing left to say.
    stiff = False if solver == "auto" else result.stiff
    counts = (result.steps, result.rejected, result.status, stiff)
    fixed = () if dt is None else ((t1 - t0) / jnp.maximum(result.steps, 1), solver)
    return Trajectory(scene, ts, result.ys, *counts, error, *fixed)


def solve(
    scene: Scene,
    t1,
    *,
    t0=0.0,
    ts=(),
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Method | str | None = None,
    dt: float | None = None,
    max_steps: int = MAX_STEPS,
    fixed: bool = False,
    adjoint: bool = False,
    noise: Noise | None = None,
) -> Flow:
    """`simulate` without samples, checks and exceptions: what the orbit finder calls.

    Compiled for each kind of scene and method; inside jit, grad and vmap it is inlined.

    Args:
      scene: system, effects, start; not checked.
      t1: () end time [s], after or before t0.
      t0: () start time [s].
      ts: (s,) wanted times [s] between t0 and t1, in the order they are passed.
      rtol: relative tolerance of one step.
      atol: absolute tolerance of one step; rtol if left out.
      solver: see `simulate`.
      dt: see `simulate`.
      max_steps: when to give up.
      fixed: make the scene's numbers, start and span apart, constants of the program: faster, but
        new ones compile again, and there are no derivatives by them.
      adjoint: derivatives by the adjoint equations, backwards in time: for one loss a few solves,
        whether it is by one number or by thousands. Reverse mode only, and once.
      noise: random changes in each step, to see what rounding does; see `rounding`.
    Returns:
      The state at t1, those at ts, and a status; NaN where the run did not get to.
    Raises:
      ValueError: a tolerance or limit of steps out of range, or a solver that does not fit.
    Limits: derivatives are those of the motion found, and lose as many digits as that, and a few
      more where it is sensitive. At rtol 1e-10 the derivative of three bodies by G is right to 11
      digits after one period and to 9 after ten, that of the Lorenz system by rho to 10 digits at
      t = 10 and to 6 at t = 20, where the state has 8; they gain a digit with each power of ten
      of rtol. Central differences are worse: 7 to 10 digits, with the best of steps. (All held
      to variational equations in 60 digits.)
    """
    auto = isinstance(solver, str) and _checks.choice("solver", solver, ("auto",)) == "auto"
    settings = checked_settings(scene, None if auto else solver, dt)
    y0, t0, t1, ts = (floats(x) for x in (scene.y0, t0, t1, ts))
    n, held_to = len(ts), limits(rtol, atol, max_steps, dt)
    field = FixedField(scene.field) if fixed else scene.field
    field = field if noise is None else RoundedField(field, noise)
    traced = _checks.is_traced((field, y0, t0, t1, ts, held_to))
    if n and not traced and not adjoint:
        # NaN is never reached; derivatives would see it, and traces compile anew anyway.
        ts = np.concatenate([ts, np.full(_filling(n), np.nan)])
        held_to = held_to._replace(samples=np.asarray(n))
    compiled = _compiled_adjoint if adjoint else _compiled
    run = functools.partial(compiled, field, y0, t0, t1, ts, held_to)
    out = _auto(run, settings, traced) if auto else run(settings=settings)
    if len(ts) == n:
        return out
    # On the host: a slice by JAX would be one more program for each number of samples.
    ys = jnp.asarray(np.asarray(out.ys)[:n])
    return Flow(out.y1, ys, out.steps, out.rejected, out.status, out.stiff)


def _auto(run: Callable[..., Flow], settings: Settings, traced: bool) -> Flow:
    """A run that an implicit method begins anew where it turns out to be stiff."""
    if traced:
        return run(settings=settings._replace(stiff=RADAU9))
    # On the host the implicit method is compiled, which takes as long again, only if it is needed.
    first = run(settings=settings._replace(stops=True))
    if not first.stiff:
        return first
    done = run(settings=settings._replace(method=RADAU9))
    return eqx.tree_at(lambda flow: flow.stiff, done, first.stiff)


def _filling(n: int) -> int:
    """By how many n is less than the next power of two."""
    return (1 << (n - 1).bit_length()) - n


def checked_settings(scene: Scene, solver: Method | None, dt=None) -> Settings:
    """What a solve is compiled for, where 64-bit floats are on and the solver fits."""
    _checks.float64()
    method = chosen_method(scene, solver)
    if method.adaptive and dt is not None:
        raise _checks.fail(
            "dt",
            f"none, since {method.name} chooses its steps by rtol",
            dt,
            "Leave it out, or take a solver of fixed step, such as solvers.KAHAN_LI8.",
        )
    if not method.adaptive and dt is None:
        raise _checks.fail(
            "dt",
            f"a step, since those of {method.name} are equal",
            "none",
            "Pass dt to simulate, say a hundredth of a period; events need an adaptive solver.",
        )
    return Settings(method)


def default_solver(scene: Scene) -> Method:
    """The method that a scene's effects call for."""
    return NYSTROM12 if scene.second_order else VERNER9


def chosen_method(scene: Scene, solver: Method | None) -> Method:
    """The method asked for, if it fits the scene, or the default one."""
    if solver is None:
        return default_solver(scene)
    if not isinstance(solver, Method):
        raise _checks.fail(
            "solver",
            "one of jaxdyn.solvers",
            type(solver).__name__,
            "solvers.from_diffrax takes any explicit Runge-Kutta solver of diffrax.",
        )
    if solver.position_only and not scene.second_order:
        raise _checks.fail(
            "solver",
            "one for forces that may depend on velocity",
            f"{solver.name}, which requires velocity-independent forces",
            "Leave the solver out, or take solvers.GAUSS12 for a long run that keeps energy.",
        )
    return solver


def _name(scene: Scene, solver: Method | str | None) -> str:
    return solver if isinstance(solver, str) else chosen_method(scene, solver).name


def explained(status: Status, scene: Scene) -> str:
    """What a status means, and where it is of a singularity, which ones the scene has."""
    singular = status in (Status.STEP_COLLAPSED, Status.NOT_FINITE)
    return f"{status.message} {scene.singular}".strip() if singular else status.message


def raise_unless_ok(status: Array, scene: Scene) -> None:
    """Raise IntegrationError for the first status in an array that is not OK; traces pass."""
    if _checks.is_traced(status):
        return
    bad = np.asarray(status)[np.asarray(status) != Status.OK]
    if bad.size:
        raise IntegrationError(explained(Status(int(bad.flat[0])), scene))


@eqx.filter_jit
def _steps_agree(motion: Trajectory) -> Array:
    """(s,) whether a step of fixed length from each sample leads where adaptive ones lead."""
    field, h, method = motion.scene.field, motion.dt, motion.method
    settings, nothing = Settings(default_solver(motion.scene)), jnp.zeros(0)
    loose = Limits(jnp.full(2, _CHECK_RTOL), jnp.asarray(_CHECK_STEPS))

    def agree(sample):
        t, y = sample
        there = field.project(t + h, y + method.in_loops(1).advance(field.rate, t, h, y).increment)
        right = flow(field, y, t, t + h, nothing, loose, settings=settings).y1
        # Both may be rounding, at rest.
        least = _CHECK_RTOL * jnp.max(jnp.abs(right))
        return jnp.max(jnp.abs(there - right)) <= _ELSEWHERE * jnp.max(jnp.abs(right - y)) + least

    return jax.lax.map(agree, (motion.ts, motion.ys))


_compiled, _compiled_adjoint = (
    jax.jit(
        lambda *args, settings, run=run: run(*args, settings=settings), static_argnames="settings"
    )
    for run in (flow, adjoint_flow)
)
