"""Equal steps and step halving: problem 3 a to d of the course.

`fixed_steps` is the plain loop y <- y + h f(t, y), or any other explicit pair, without error
control. `halvings` runs it with successively halved steps. If the error falls like h^p, the
solutions with steps h and h / 2 differ by (2^p - 1) times the error of the second, so three
solutions give p, and two the error, without the exact solution.
"""

import itertools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.integrate.spans import span
from jaxdyn.scene import Scene
from jaxdyn.solvers import EULER, Method, Solver
from jaxdyn.solvers.choice import method_of
from jaxdyn.solvers.perturbed import Noise, RoundedField, perturbed_start


@check_first
def fixed_steps(
    scene: Scene,
    t1=None,
    *,
    steps=1000,
    t0=0.0,
    method: Solver = EULER,
    noise: Noise | None = None,
) -> Array:
    """(k,) state at t1 after equal steps from the start of a scene.

    Args:
      scene: system, effects, start.
      t1: () end time [s]; the scene's own span by default.
      steps: () number of steps; a new number does not recompile.
      t0: () start time [s].
      method: a `Pair`, such as `solvers.RK4`, or an explicit solver of diffrax; its error estimate
        is not used.
      noise: random perturbation of each step, to measure the effect of rounding; see
        `solvers.perturbed`.
    Raises:
      ValueError: `steps` is less than 1, or `t0`, `t1` or `method` is invalid.
    Limits: the error is not controlled: too large a step gives wrong or infinite numbers.
    Example:
      >>> from jaxdyn import scenes
      >>> from jaxdyn.accuracy import convergence as steps
      >>> rough = steps.fixed_steps(scenes.oscillator(), 1.0, steps=10)
      >>> round(float(rough[0]), 4), round(float(jnp.cos(1.0)), 4)
      (0.5708, 0.5403)
    """
    t0, t1 = span(scene, t1, t0)
    if not _checks.is_traced(steps) and steps < 1:
        raise _checks.fail("steps", "at least 1", steps)
    field = scene.field if noise is None else RoundedField(scene.field, noise)
    return _march(field, scene.y0, t0, t1, jnp.asarray(steps, int), method_of(method))


@eqx.filter_jit
def _march(field, y0: Array, t0: Array, t1: Array, steps: Array, method: Method) -> Array:
    h = (t1 - t0) / steps.astype(float)

    def step(i, y):
        t = t0 + i * h
        now, start, near = perturbed_start(field, t, y)
        increment = method.advance(now.rate, start, h, near).increment
        # This sum is not compensated.
        return field.project(t + h, near + increment)

    return jax.lax.fori_loop(0, steps, step, y0)


class Halvings(NamedTuple):
    """Solutions with successively halved steps, in n rows.

    Attributes:
      steps: (n,) number of steps.
      ys: (n, k) states at the end.
      errors: (n,) estimated largest error of each; NaN for the first two, where p is unknown.
      orders: (n,) observed order p from each and the two before; NaN for the first two.
    """

    steps: np.ndarray
    ys: np.ndarray
    errors: np.ndarray
    orders: np.ndarray


@check_first
def halvings(
    scene: Scene, t1=None, *, steps: int = 64, rows: int = 6, t0=0.0, method: Solver = EULER
) -> Halvings:
    """Solutions with successively halved steps, and estimates of their errors; host only.

    Args:
      scene: system, effects, start.
      t1: () end time [s]; the scene's own span by default.
      steps: number of steps of the first row.
      rows: number of rows, at least 3.
      t0: () start time [s].
      method: see `fixed_steps`.
    Returns:
      Steps, states, estimated errors, observed orders. An order far from the method's means that
      the steps are too large, or that rounding dominates: then no estimate is reliable.
    Raises:
      ValueError: `rows` is less than 3, or see `fixed_steps`.
    """
    _checks.check_on_host("scene", scene)
    if rows < 3:
        raise _checks.fail("rows", "at least 3", rows, "An order needs three solutions.")
    counts = steps * 2 ** np.arange(rows)
    run = (fixed_steps(scene, t1, steps=int(n), t0=t0, method=method) for n in counts)
    ys = np.stack([np.asarray(y) for y in run])
    changes = np.array(
        [
            np.abs(scene.system.difference(jnp.asarray(b), jnp.asarray(a))).max()
            for a, b in itertools.pairwise(ys)
        ]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = changes[:-1] / changes[1:]
        unknown = np.full(2, np.nan)
        orders = np.concatenate([unknown, np.log2(ratios)])
        errors = np.concatenate([unknown, changes[1:] / (ratios - 1)])
    return Halvings(
        steps=counts, ys=ys, errors=np.where(errors >= 0, errors, np.nan), orders=orders
    )
