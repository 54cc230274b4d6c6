"""Lyapunov exponents of a motion: the mean rates at which nearby motions diverge or converge.

Tangents are integrated with the motion and orthonormalised at short intervals (`stretching`). The
logarithms of their stretching are summed in `BATCHES` equal parts of the time: their mean is the
exponent, their scatter its error bar.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.analysis.monodromy import tangents
from jaxdyn.chaos.spectrum import BATCHES, LyapunovSpectrum, judge
from jaxdyn.chaos.stretching import carry, start
from jaxdyn.integrate.flow import flow
from jaxdyn.integrate.march import Limits
from jaxdyn.integrate.spans import MAX_STEPS, SolverOptions, limits, span
from jaxdyn.integrate.trajectory import raise_unless_ok
from jaxdyn.scales import sizes_at_start
from jaxdyn.scene import Field, Scene
from jaxdyn.solvers import Method, Solver
from jaxdyn.solvers.choice import check_method
from jaxdyn.status import Status

#: Default relative tolerance of a step: the statistical error is far larger than that of the steps.
RTOL = 1e-9
_TRANSIENT = 0.1  # fraction of the time that is skipped by default
_STEPS_OF_A_CHUNK = 3.0  # with more, digits of the smallest factor are lost; fewer take more time


@check_first
def lyapunov_exponents(
    scene: Scene,
    t1=None,
    *,
    t0=0.0,
    transient=None,
    count: int | None = None,
    chunk=None,
    rtol: float = RTOL,
    atol: float | None = None,
    solver: Solver | None = None,
    max_steps: int = MAX_STEPS,
    throw: bool = True,
) -> LyapunovSpectrum:
    """The Lyapunov exponents of a scene's motion, with error bars and checks.

    The bars are the sum of two parts. The statistical one is Student's 95 % interval of the mean of
    `BATCHES` batches. The other, log((transient + time) / transient) / time, is the mean rate of a
    tangent that grows in proportion to time: tangents of regular motions do, and their exponents
    are zero.

    Args:
      scene: system, effects, start.
      t1: () end time [s], after or before t0; the scene's own span by default, which is usually far
        too short: bars shrink with the square root of the time.
      t0: () start time [s].
      transient: () time left out at the start [s], during which the motion approaches its attractor
        and the tangents their directions; a tenth of the time by default.
      count: number of exponents from the largest; by default all, as many as the state has entries
        less those fixed by constraints.
      chunk: () time between orthonormalisations [s]; by default three mean steps of the motion.
      rtol: relative tolerance of a step.
      atol: absolute tolerance of one step, in the units of the state; by default a quarter of
        rtol times the largest size so far of the entries of its kind, whatever the units
        (`scales.Groups`).
      solver: see `simulate`.
      max_steps: largest number of steps of a chunk, and of the transient.
      throw: raise on any status but OK; with False check `LyapunovSpectrum.status`.
    Returns:
      The exponents, their bars, the sums that must hold, the Kaplan-Yorke dimension.
    Raises:
      ValueError: `transient` is not between 0 and the time, `count` is not between 1 and the
        number of exponents, `chunk` is not positive, or see `simulate`.
      IntegrationError: the end was not reached (``throw=True``).
    Limits: host only. The exponents are those of one motion; others of the same scene may differ.
      Bars assume batches far longer than the motion's memory: a motion that sticks to a regular
      region for most of the time has bars that are too small. A driven scene has no zero exponent
      along the flow unless time is an entry of its state. New values of numbers, t1 included, do
      not compile again.
    Reference: Benettin, Galgani, Giorgilli & Strelcyn (1980), Meccanica 15, 9; Shimada & Nagashima
      (1979), Prog. Theor. Phys. 61, 1605.
    Example:
      >>> import jaxdyn
      >>> from jaxdyn import scenes
      >>> found = jaxdyn.lyapunov_exponents(scenes.lorenz(), 1000.0)
      >>> abs(float(found.exponents[0]) - 0.9056) < float(found.bars[0])  # Sprott (2003)
      True
      >>> abs(float(found.trace_residual)) < 1e-6
      True
    """
    t0, t1 = span(scene, t1, t0)
    _checks.check_untraced("scene", (scene, t0, t1), "Call it outside of jit, grad and vmap.")
    left_out = _transient(transient, float(t1 - t0))
    # One method, with its stages in a loop, for the motion with and without tangents: fast to
    # compile.
    method = check_method(scene, solver).for_tangents.in_loops(1)
    sizes = sizes_at_start(scene, t0, t1)
    frame = np.asarray(_frame(scene, sizes, count))
    given = 0.0 if chunk is None else float(_checks.positive("chunk", chunk, "It is a time."))
    found = _spectrum(
        scene.field,
        scene.y0,
        frame,
        sizes,
        np.array([t0, t1, left_out, given]),
        limits(SolverOptions(rtol=rtol, atol=atol, max_steps=max_steps)),
        method=method,
    )
    if throw:
        raise_unless_ok(found.status, scene)
    return found


def _transient(transient, time: float) -> float:
    if time == 0:
        raise _checks.fail("t1", "an end after or before t0", "t0 itself")
    if transient is None:
        return _TRANSIENT * abs(time)
    left_out = float(_checks.array("transient", transient, ()))
    if not 0 < left_out < abs(time):
        wanted = f"between 0 and the time, {abs(time):g}"
        raise _checks.fail("transient", wanted, left_out, "It is a part of the time, left out.")
    return left_out


def _frame(scene: Scene, sizes: np.ndarray, count: int | None) -> np.ndarray:
    """(k, m) orthonormal tangents at the start, along the constraints, in generic directions.

    They are orthonormal in the sizes (k,) of the entries.
    """
    basis = np.linalg.qr(tangents(scene, scene.y0) / sizes[:, None])[0]
    d = basis.shape[1]
    m = d if count is None else _checks.whole("count", count, 1, d)
    # A tangent along an axis may be an invariant direction that is not the one of fastest growth.
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(d, d)))[0]
    return basis @ turn[:, :m]


@functools.partial(jax.jit, static_argnames="method")
def _spectrum(
    field: Field,
    y0: Array,
    frame: Array,
    sizes: Array,
    times: Array,
    limits: Limits,
    *,
    method: Method,
) -> LyapunovSpectrum:
    """The result from times (4,): start, end, transient, and the chunk or 0."""
    t0, t1, transient, given = times
    direction = jnp.where(t1 > t0, 1.0, -1.0)
    # First the motion alone, which gives the length of its steps, then with its tangents.
    half = 0.5 * transient
    alone = flow(field, y0, t0, t0 + direction * half, jnp.zeros(0), limits, method=method)
    mean = _STEPS_OF_A_CHUNK * half / jnp.maximum(alone.steps.astype(float), 1.0)
    length = jnp.where(given > 0, given, mean)

    def carried(begun, t, time):
        """The tangents after a time from t, in a whole number of chunks."""
        count = jnp.ceil(time / length)
        chunk = direction * time / count
        return carry(field, begun, sizes, t, chunk, count, limits, method)

    first = start(alone.y1, frame, alone.status)
    ready = carried(first, t0 + direction * half, half)
    time = jnp.abs(t1 - t0) - transient
    batch = time / BATCHES

    def one(now, i):
        t = t0 + direction * (transient + i * batch)
        end = carried(start(now.y, now.frame, now.status), t, batch)
        return end, (end.logs, end.divergence, end.steps)

    end, (logs, divergences, all_steps) = jax.lax.scan(one, ready, jnp.arange(float(BATCHES)))
    lost = end.status != Status.OK
    logs, divergences = (jnp.where(lost, jnp.nan, x) for x in (logs, divergences))
    shear = (jnp.log((transient + time) / transient) / time)[None]
    spectrum = judge(logs / batch, jnp.sum(divergences) / time, shear, len(y0))
    return LyapunovSpectrum(
        **spectrum,
        time=time,
        chunk=batch / jnp.ceil(batch / length),
        steps=jnp.sum(all_steps),
        status=end.status,
    )
