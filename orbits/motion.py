"""Where a motion is after a span of time, and in which time it is followed there.

Bodies that attract each other are followed in logarithmic time (`jaxdyn.analysis.regularised`)
where errors grow much, or rounding is what is left of a search. In plain time each close encounter
multiplies the rounding of the state by what bends the paths there; a published three-body orbit
whose multipliers are 1 then closes to 1e-7, at 1e-12 in logarithmic time.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.analysis.energy import potential
from jaxdyn.analysis.regularised import logarithmic_span, regularised, solve_regularised
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.flow import Flow
from jaxdyn.integrate.simulation import MAX_STEPS, solve
from jaxdyn.solvers import Solver

#: Logarithmic time runs too fast where the potential nearly vanishes: its least value must be at
#: least this share of the median along the motion.
_SHALLOW = 0.05


def advanced(
    scene: Scene,
    span,
    s=None,
    *,
    t0=0.0,
    rtol: float,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
) -> Flow:
    """The end of a motion after a span of time; differentiable in all numbers but s.

    Args:
      scene: what moves, at its start.
      span: () time from t0 on.
      s: () span of logarithmic time to follow first; None to stay in plain time.
      t0: () start time.
      rtol: tolerance of the integration.
      solver: the default one if left out.
      max_steps: when to give up.
    """
    how = {"t0": t0, "rtol": rtol, "solver": solver, "max_steps": max_steps}
    if s is None:
        return solve(scene, t0 + span, **how)
    return solve_regularised(scene, t0 + span, jax.lax.stop_gradient(s), **how)


def attracts(scene: Scene, ts: np.ndarray | None = None, ys: Array | None = None) -> bool:
    """Whether bodies attract each other at the start, or along states ys (n, k) at times ts."""
    if not (scene.system.second_order and scene.has_points):
        return False
    if ts is None or ys is None:
        ts, ys = np.zeros(1), scene.y0[None]
    depth = np.asarray(_depth(scene, ts, ys))
    return bool(np.isfinite(depth).all() and depth.min() > _SHALLOW * np.median(depth))


def gravitates(scene: Scene) -> bool:
    """Whether free points move under their mutual attraction alone.

    Kepler's third law then scales every motion: lengths by s, times by s^(3/2).
    """
    alone = [type(effect) for effect in scene.effects] == [PairGravity]
    return alone and isinstance(scene.system, FreePoints)


def logarithmic_period(scene: Scene) -> float | None:
    """The logarithmic time that passes over a scene's span; None where it does not lead there."""
    s = float(logarithmic_span(scene, scene.t1)) if attracts(scene) else math.nan
    return s if math.isfinite(s) else None


@jax.jit
def _depth(scene: Scene, ts: Array, ys: Array) -> Array:
    """(n,) minus the potential energy along a motion [J]."""
    return -jax.vmap(lambda t, y: potential(scene, t, y))(ts, ys)


@jax.jit
def at_s(scene: Scene, s: Array, rtol) -> tuple[Array, Array]:
    """(n,) when logarithmic times s (n,), the last one the end, have passed; (n, k) states then."""
    run = solve(regularised(scene), s[-1], ts=s, rtol=rtol)
    return run.ys[:, -1], run.ys[:, :-2]


def at_even_s(scene: Scene, s, rtol, *, samples: int) -> tuple[Array, Array]:
    """(samples + 1,) when s has passed in equal parts, and minus the potential energy there [J]."""
    ts, ys = at_s(scene, jnp.linspace(0.0, s, samples + 1), rtol)
    return ts, _depth(scene, ts, ys)
