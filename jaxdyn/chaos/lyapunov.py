"""Lyapunov exponents of a motion: the mean rates at which nearby motions part or approach.

Tangents are integrated with the motion and orthonormalised at short intervals (`stretching`). The
logarithms of their stretching are summed in `BATCHES` equal parts of the time: their mean is the
exponent, their scatter its error bar.
"""

import dataclasses
import functools
import math
from typing import Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn.analysis.monodromy import tangents
from jaxdyn.chaos.stretching import carry, start
from jaxdyn.integrate.flow import Settings, flow
from jaxdyn.integrate.spans import MAX_STEPS, SolverOptions, limits, span
from jaxdyn.integrate.step_control import Limits
from jaxdyn.integrate.trajectory import raise_unless_ok
from jaxdyn.scene import Field, Scene
from jaxdyn.solvers import Solver
from jaxdyn.solvers.choice import checked_method
from jaxdyn.status import Status
from jaxdyn.system import Record

#: Parts of the time whose means are compared.
BATCHES = 32
#: Default relative tolerance of a step: the statistical error is far larger than that of the steps.
RTOL = 1e-9
#: Two-sided 95 % quantile of Student's t with BATCHES - 1 degrees of freedom.
_STUDENT = 2.04
_TRANSIENT = 0.1  # of the time, by default left out
_STEPS_OF_A_CHUNK = 3.0  # more lose digits of the smallest factor, fewer take more time


class LyapunovSpectrum(Record):
    """Lyapunov exponents, their error bars, and the sums that must hold.

    Attributes:
      exponents: (m,) in the order of the tangents, which tends to descending order [1/s].
      bars: (m,) half-widths of 95 % intervals [1/s]; see `lyapunov_exponents`.
      batches: (BATCHES, m) means over equal parts of the time [1/s].
      divergence: () mean divergence of the rate along the motion [1/s], to which all exponents
        add up.
      trace_residual: () sum of all exponents minus `divergence` [1/s]: the error of the
        integration, not of the average; NaN for an incomplete spectrum.
      pairing_residual: () largest deviation of a sum of the i-th exponent from above and the i-th
        from below from its value 2 `divergence` / k [1/s]; within the bars for Hamiltonian scenes,
        also with uniform damping (Dressler 1988), and of no meaning for others. NaN for an odd or
        incomplete spectrum.
      dimension: () Kaplan-Yorke dimension [1]: that of the set on which the motion runs, if its
        volume neither grows nor shrinks; NaN if the exponents are too few to tell.
      dimension_bar: () its error bar [1], from those of the exponents.
      time: () the time averaged over, without the transient [s].
      chunk: () time between two orthonormalisations [s].
      steps: () accepted steps of the motion with its tangents.
      status: () `Status` code; numbers are NaN unless it is OK.

    Reference: Kaplan & Yorke (1979), Lecture Notes in Mathematics 730, 204; Dressler (1988),
      Phys. Rev. A 38, 2103.
    """

    exponents: Array
    bars: Array
    batches: Array
    divergence: Array
    trace_residual: Array
    pairing_residual: Array
    dimension: Array
    dimension_bar: Array
    time: Array
    chunk: Array
    steps: Array
    status: Annotated[Array, Status]

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [
            (f"exponent {i + 1}", f"{float(x): .6f} +- {float(bar):.1e}")
            for i, (x, bar) in enumerate(zip(self.exponents, self.bars, strict=True))
        ]
        rows += [
            ("dimension", f"{float(self.dimension):.5f} +- {float(self.dimension_bar):.1e}"),
            ("divergence", _text.brief(self.divergence)),
            ("residuals", f"trace {float(self.trace_residual):.1e}, "
                          f"pairing {float(self.pairing_residual):.1e}"),
            ("time", f"{_text.brief(self.time)}, in chunks of {_text.brief(self.chunk)}"),
            ("status", f"{Status(int(self.status)).name}: {self.message}"),
        ]  # fmt: skip
        return _text.table("LyapunovSpectrum", _text.cut(rows[:-5]) + rows[-5:])

    @property
    def ok(self) -> bool:
        """Whether the motion reached its end; host only."""
        return int(self.status) == Status.OK

    @property
    def message(self) -> str:
        """How the integration ended, and the remedy; host only."""
        return Status(int(self.status)).message

    def as_dict(self) -> dict[str, Any]:
        """All numbers but the batches as lists, with None for NaN; host only."""
        names = (field.name for field in dataclasses.fields(self))
        return {name: finite_lists(getattr(self, name)) for name in names if name != "batches"}


def finite_lists(x: Any) -> Any:
    """The numbers of an array as nested lists, with None for NaN."""
    values = np.asarray(x)
    return np.where(np.isnan(values), None, values.astype(object)).tolist()


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
      atol: absolute tolerance of a step; rtol by default.
      solver: see `simulate`.
      max_steps: largest number of steps of a chunk, and of the transient.
      throw: raise on any status but OK; with False look at `LyapunovSpectrum.status`.
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
    _checks.untraced("scene", (scene, t0, t1), "Call it outside of jit, grad and vmap.")
    left_out = _transient(transient, float(t1 - t0))
    # One method for the motion with and without tangents, with its stages in a loop: compiles fast.
    settings = Settings(checked_method(scene, solver).for_tangents.in_loops(1))
    frame = np.asarray(_frame(scene, count))
    given = 0.0 if chunk is None else float(_checks.positive("chunk", chunk, "It is a time."))
    found = _spectrum(
        scene.field,
        scene.y0,
        frame,
        np.array([t0, t1, left_out, given]),
        limits(SolverOptions(rtol=rtol, atol=atol, max_steps=max_steps)),
        settings=settings,
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


def _frame(scene: Scene, count: int | None) -> np.ndarray:
    """(k, m) orthonormal tangents at the start, along the constraints, in generic directions."""
    basis = tangents(scene, scene.y0)
    d = basis.shape[1]
    m = d if count is None else _checks.whole("count", count, 1, d)
    # A tangent along an axis may be an invariant direction that is not the one of fastest growth.
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(d, d)))[0]
    return basis @ turn[:, :m]


@functools.partial(jax.jit, static_argnames="settings")
def _spectrum(
    field: Field, y0: Array, frame: Array, times: Array, limits: Limits, *, settings: Settings
) -> LyapunovSpectrum:
    """The result from times (4,): start, end, transient, and the chunk or 0."""
    t0, t1, transient, given = times
    direction = jnp.where(t1 > t0, 1.0, -1.0)
    # First the motion alone, which tells how long its steps are, then with its tangents.
    half = 0.5 * transient
    alone = flow(field, y0, t0, t0 + direction * half, jnp.zeros(0), limits, settings=settings)
    mean = _STEPS_OF_A_CHUNK * half / jnp.maximum(alone.steps.astype(float), 1.0)
    length = jnp.where(given > 0, given, mean)

    def carried(begun, t, time):
        """The tangents after a time from t, in a whole number of chunks."""
        count = jnp.ceil(time / length)
        chunk = direction * time / count
        return carry(field, begun, t, chunk, count, limits, settings)

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
    spectrum = _judged(logs / batch, jnp.sum(divergences) / time, shear, len(y0))
    return LyapunovSpectrum(
        **spectrum,
        time=time,
        chunk=batch / jnp.ceil(batch / length),
        steps=jnp.sum(all_steps),
        status=end.status,
    )


def _judged(batches: Array, divergence: Array, shear: Array, k: int) -> dict[str, Array]:
    """The fields of a spectrum that follow from the means (BATCHES, m) over its batches."""
    exponents, bars = _mean(batches, shear)
    m = len(exponents)
    full = m == k
    trace = jnp.sum(exponents) - divergence
    pairs = exponents + exponents[::-1] - (2.0 * divergence / k)[None]
    none = jnp.full((), jnp.nan)
    dimension, dimension_bar = _kaplan_yorke(batches, shear, full)
    return {
        "exponents": exponents,
        "bars": bars,
        "batches": batches,
        "divergence": divergence,
        "trace_residual": trace if full else none,
        "pairing_residual": jnp.max(jnp.abs(pairs)) if full and k % 2 == 0 else none,
        "dimension": dimension,
        "dimension_bar": dimension_bar,
    }


def _mean(batches: Array, shear: Array) -> tuple[Array, Array]:
    """Means of batches (BATCHES, m) and their bars (m,)."""
    scatter = jnp.std(batches, axis=0, ddof=1) / math.sqrt(BATCHES)
    return jnp.mean(batches, axis=0), _STUDENT * scatter + shear


def _kaplan_yorke(batches: Array, shear: Array, full: bool) -> tuple[Array, Array]:
    """The dimension j + (sum of the first j exponents) / |the next one|, and its bar.

    j is the largest number of exponents whose sum is not negative. A sum within its own bar of
    zero counts as zero: that of a limit cycle's first exponent, that of all of a conservative
    scene.
    """
    exponents, bars = _mean(batches, shear)
    sums, sum_bars = _mean(jnp.cumsum(batches, axis=1), shear)
    held = sums >= -sum_bars
    j = jnp.sum(jnp.cumprod(held.astype(int)))
    m = len(exponents)
    before = jnp.where(j > 0, jnp.take(sums, j - 1, mode="clip"), 0.0)
    before_bar = jnp.where(j > 0, jnp.take(sum_bars, j - 1, mode="clip"), 0.0)
    zero = before <= before_bar
    rate = jnp.abs(jnp.take(exponents, j, mode="clip"))
    share = jnp.where(zero, 0.0, before / rate)
    bar = (before_bar + share * jnp.take(bars, j, mode="clip")) / rate
    whole = jnp.where(full, float(m), jnp.nan)
    unknown = jnp.isnan(exponents).any()
    dimension = jnp.where(j == m, whole, j.astype(float) + share)
    bar = jnp.where(j == m, whole * 0.0, bar)
    return jnp.where(unknown, jnp.nan, dimension), jnp.where(unknown, jnp.nan, bar)
