"""How long a motion can be trusted: the predictability horizon of chaotic motions.

Nearby motions of a chaotic scene diverge like exp(growth t). An error of a step, or of rounding, is
amplified likewise, so every tolerance has its horizon, and one that is a thousand times tighter
moves it by no more than log(1000) / growth. Beyond it a solution is one of the motions of the
scene, but not the one from its start.

The time reported is measured, not predicted: it is where two solutions differ in the requested
digits, including the effect of rounding (`integrate.errors`). The growth rate, from the tangent
map, says how much a tighter tolerance would gain.
"""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.accuracy import estimates
from jaxdyn.integrate.errors import Estimate
from jaxdyn.integrate.simulation import RTOL, solve
from jaxdyn.scene import Scene
from jaxdyn.solvers import Method, Solver
from jaxdyn.solvers.choice import choose_method

_SAMPLES = 201


@dataclasses.dataclass(frozen=True)
class Trust:
    """How long a solution can be trusted.

    Attributes:
      t: the last sample time up to which all samples have the requested digits [s]; NaN if not
        even the start has. Where digits are not lost it is the end of the span.
      most: the same for the finest tolerance that doubles allow [s].
      growth: rate at which nearby motions diverge, in the second half of the time to t [1/s]; NaN
        where there are fewer than two samples.
      digits: the requested digits.
      estimate: the errors that t is based on, at all times.
    """

    t: float
    most: float
    growth: float
    digits: float
    estimate: Estimate

    def at(self, rtol: float) -> float:
        """Time [s] for which a tolerance rtol has these digits, by growth alone: a rule of thumb.

        Infinite where nearby motions do not diverge.
        """
        return math.inf if self.growth <= 0 else math.log(10.0**-self.digits / rtol) / self.growth


@check_first
def trusted_time(
    scene: Scene,
    t1=None,
    *,
    digits: float = 3.0,
    t0: float = 0.0,
    samples=_SAMPLES,
    rtol: float = RTOL,
    solver: Solver | None = None,
) -> Trust:
    """Time up to which a solution at a tolerance has the requested digits, and how they are lost.

    Args:
      scene: system, effects, start.
      t1: () end of the span [s]; the scene's own by default.
      digits: requested correct digits, relative to the largest entry of the same unit.
      t0: () start time [s].
      samples: number of times, or an array of times (s,).
      rtol: tolerance of the solution.
      solver: see `simulate`.
    Returns:
      The time, the same for the finest tolerance, the growth rate, and their basis.
    Raises:
      ValueError: `digits` is not above 0 and at most 15, or see `simulate`.
      IntegrationError: the end was not reached.
    Limits: an estimate. Compared with motions in 60 digits and more, of double and triple
      pendulums and three bodies, it is within a tenth of the true time (`jaxdyn hard`).
    Reference: Lighthill (1986), Proc. R. Soc. A 407, 35.
    Example:
      >>> from jaxdyn.accuracy import horizon
      >>> from jaxdyn import scenes
      >>> swing = horizon.trusted_time(scenes.double_pendulum(t1=60.0), digits=3, rtol=1e-8)
      >>> 20 < swing.t < 60
      True
    """
    _checks.check_digits(digits)
    found = estimates.estimate(scene, t1, t0=t0, samples=samples, rtol=rtol, solver=solver)
    t = found.until(digits)
    most = eqx.tree_at(lambda e: e.error, found, found.rounding).until(digits)
    tangents = _tangents(scene, found.ts, jnp.asarray(float(t0)), choose_method(scene, solver))
    return Trust(
        t=t,
        most=most,
        growth=_growth(found, np.asarray(tangents), t),
        digits=digits,
        estimate=found,
    )


@eqx.filter_jit
def _tangents(scene: Scene, ts: Array, t0: Array, solver: Method) -> Array:
    """(s, k, k) derivatives of the states at ts with respect to the start."""

    def states(y):
        return solve(scene.starting(y), ts[-1], t0=t0, ts=ts, solver=solver).ys

    return jax.jacfwd(states)(scene.y0)


def _growth(found: Estimate, tangents: np.ndarray, t: float) -> float:
    """Slope of the logarithm of the largest stretch over time, by least squares.

    It is found in the second half of the time up to t: at first the stretch depends on the units,
    and long after t tangents may overflow.
    """
    scale, ts = np.asarray(found.scale), np.asarray(found.ts)
    elapsed, end = np.abs(ts - ts[0]), abs(t - ts[0])
    late = (elapsed <= end) & (2 * elapsed >= end)
    if late.sum() < 2:
        return math.nan
    stretch = np.linalg.norm(tangents[late] * scale[None, None, :] / scale[:, None], 2, (1, 2))
    return float(np.polyfit(elapsed[late], np.log(stretch), 1)[0])
