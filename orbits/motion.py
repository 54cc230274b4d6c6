"""The state after a span of time, integrated in plain or in logarithmic time.

Bodies that attract each other are integrated in logarithmic time (`jaxdyn.analysis.regularized`)
where errors grow strongly, or where rounding keeps a search from its goal. In plain time each close
encounter amplifies the rounding of the state: a published three-body orbit whose multipliers are 1
closes to 1e-7 in plain time, and to 1e-12 in logarithmic time.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status, System
from jaxdyn._checks import is_traced
from jaxdyn.analysis.energy import potential
from jaxdyn.analysis.regularized import logarithmic_span, regularize, solve_regularized
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.flow import SolveResult
from jaxdyn.integrate.simulation import MAX_STEPS, solve
from jaxdyn.solvers import DOPRI8, VERNER9, Method, Solver, default_solver
from jaxdyn.solvers.choice import choose_method

#: The smallest depth of the potential along a motion, as a share of the median, at which
#: logarithmic time is used: that time diverges where the potential vanishes.
_LEAST_DEPTH = 0.05
_TRIALS = 40  # most trial spans of logarithmic time for one motion
_SAMPLES = 64  # samples of a motion, from which the sizes of its entries follow
_SAMPLE_RTOL = 1e-6  # tolerance of these samples: a size needs no more digits
_SAMPLE_STEPS = 20_000  # step limit for a motion that is not known to be an orbit


def advance(
    scene: Scene,
    span,
    s=None,
    *,
    t0=0.0,
    rtol: float,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
) -> SolveResult:
    """The end of a motion after a span of time; differentiable with respect to all but s.

    Args:
      scene: the scene; the motion starts at its start.
      span: () length of the motion [time of the scene].
      s: () span of logarithmic time to integrate over first; None for plain time.
      t0: () start time.
      rtol: relative tolerance of the integration, between 0 and 1.
      solver: integration method; by default that of `jaxdyn.solve`.
      max_steps: largest number of steps, at least 1.
    """
    t1 = t0 + span
    if s is None:
        return quick_solve(scene, t1, t0=t0, rtol=rtol, solver=solver, max_steps=max_steps)
    s = jax.lax.stop_gradient(s)
    return solve_regularized(scene, t1, s, t0=t0, rtol=rtol, solver=solver, max_steps=max_steps)


def quick_solve(
    scene: Scene,
    t1,
    *,
    t0=0.0,
    ts=(),
    rtol: float,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
) -> SolveResult:
    """`jaxdyn.solve` in a smaller program, for motions that are computed only a few times.

    A method whose stages are in a loop compiles in a third of the time and takes up to 1.5 times
    as long to run. If only the end is wanted, it is requested as one sample, since one compiled
    program serves any number of samples.
    """
    method = choose_method(scene, solver, several=True).in_loops(1)
    if not len(ts) and not is_traced((scene, t0, t1, rtol, max_steps)):
        ts = np.reshape(t1, 1)
    return solve(scene, t1, t0=t0, ts=ts, rtol=rtol, solver=method, max_steps=max_steps)


def other_solver(scene: Scene, solver: Method | None = None, *, logarithmic: bool) -> Method:
    """A method other than those that `advance` uses for a scene, with tangents or without.

    A given solver, such as that for stiff motions, has no alternative and is returned as it is.
    """
    if solver is not None:
        return solver
    method = default_solver(scene)
    return DOPRI8 if logarithmic or VERNER9 in (method, method.for_tangents) else VERNER9


def attracts(scene: Scene, ts: np.ndarray | None = None, ys: Array | None = None) -> bool:
    """Whether bodies attract each other at the start, or at states ys (n, k) at times ts (n,)."""
    if not (scene.system.second_order and scene.has_points):
        return False
    known = ts is not None and ys is not None
    at = (ts, ys) if known else (np.zeros(1), np.asarray(scene.y0)[None])
    depth = np.asarray(_depth(scene, *at))
    return bool(np.isfinite(depth).all() and depth.min() > _LEAST_DEPTH * np.median(depth))


def has_several_points(system: System) -> bool:
    """Whether a system is several free points, described relative to their centre of mass."""
    return isinstance(system, FreePoints) and len(system.m) > 1


def gravitates(scene: Scene) -> bool:
    """Whether free points move under their mutual attraction alone.

    Kepler's third law then scales every motion: lengths by s, times by s^(3/2).
    """
    alone = [type(effect) for effect in scene.effects] == [PairGravity]
    return alone and isinstance(scene.system, FreePoints)


def logarithmic_period(scene: Scene) -> float | None:
    """The span of logarithmic time of a scene's motion; None where that time cannot be used."""
    s = float(logarithmic_span(scene, scene.t1)) if attracts(scene) else math.nan
    return s if math.isfinite(s) else None


def logarithmic_places(scene: Scene, n: int, rtol: float) -> np.ndarray | None:
    """(n,) evenly spaced logarithmic times of a scene's motion; None if that time cannot be used.

    The logarithmic time of the whole motion is interpolated from the times at trial values, with
    the program of `at_s` that the caller needs anyway: `logarithmic_period` would compile a search
    for an event, the longest program of a report.
    """
    if not attracts(scene):
        return None
    end, shares = float(scene.t1), np.arange(n) / n
    s = end * float(np.asarray(_depth(scene, np.zeros(1), np.asarray(scene.y0)[None]))[0])
    for _ in range(_TRIALS):
        ts = np.asarray(at_s(scene, shares * s, rtol)[0])
        reached = np.isfinite(ts)
        last = ts[reached][-1]
        if last > end:
            found = np.interp(end, ts[reached], shares[reached] * s)
            if last < 2 * end:
                return shares * found
            s = (1 + 1 / 16) * found  # again and finer: the motion covers few of these values
        elif reached.all():
            s = 2 * s
        else:
            return None
    return None


@jax.jit
def _depth(scene: Scene, ts: Array, ys: Array) -> Array:
    """(n,) minus the potential energy at states ys (n, k) at times ts (n,) [J]."""
    return -jax.vmap(lambda t, y: potential(scene, t, y))(ts, ys)


@jax.jit
def at_s(scene: Scene, s: Array, rtol) -> tuple[Array, Array]:
    """(n,) times and (n, k) states at logarithmic times s (n,), the last of which is the end."""
    flow = solve(regularize(scene), s[-1], ts=s, rtol=rtol)
    return flow.ys[:, -1], flow.ys[:, :-2]


def at_even_s(scene: Scene, s, rtol, *, samples: int) -> tuple[Array, Array]:
    """Times, and minus the potential energy [J], at equal parts of s; (samples + 1,) each."""
    ts, ys = at_s(scene, jnp.linspace(0.0, s, samples + 1), rtol)
    return ts, _depth(scene, ts, ys)


def sample(scene: Scene, span: float) -> tuple[np.ndarray, np.ndarray]:
    """(s,) times and (s, k) states of a scene's motion; the start alone if it ends early."""
    ts = np.linspace(0.0, span, _SAMPLES + 1)
    flow = quick_solve(scene, span, ts=ts, rtol=_SAMPLE_RTOL, max_steps=_SAMPLE_STEPS)
    if int(flow.status) != Status.OK:
        return ts[:1], np.asarray(scene.y0)[None]
    return ts, np.asarray(flow.ys)
