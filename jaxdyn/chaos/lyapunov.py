"""Lyapunov exponents of a motion: the mean rates at which nearby motions diverge or converge.

`propagate_tangents` integrates tangents with the motion and orthonormalises them at short
intervals. The logarithms of their stretching are summed in `BATCHES` equal parts of the time: their
mean is the exponent, their scatter its error bar.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.analysis.monodromy import balancing, invariant_form, tangents
from jaxdyn.chaos.timed import Timed
from jaxdyn.integrate.flow import Variational, flow
from jaxdyn.integrate.march import Limits
from jaxdyn.integrate.spans import MAX_STEPS, SolverOptions, limits, span
from jaxdyn.integrate.trajectory import raise_unless_ok
from jaxdyn.plan.branch import Branch
from jaxdyn.scales import sizes_at_start
from jaxdyn.scene import Field, FieldAround, Scene
from jaxdyn.solvers import Method, Solver
from jaxdyn.solvers.choice import check_method
from jaxdyn.status import Status

# ---- Orthonormal tangents carried along a motion, and the factors by which they are stretched
#
# A frame Q of orthonormal tangents is integrated with the motion over a short chunk and then
# orthonormalised again, V = Q' R. The diagonal of R contains the factors by which the chunk
# stretches the flag of subspaces that Q spans; it is positive, and the sum of the logarithms over
# time tends to the Lyapunov exponents.
#
# Orthonormalisation is by Gram-Schmidt with each column projected twice, which is as orthogonal as
# Householder's (Giraud, Langou & Rozloznik 2005), without LAPACK inside the loop.


#: A smaller factor counts as 0: nearby motions merge there, as where dry friction stops them.
_LOST = 1e-10
#: It stands for the logarithm of 0, minus infinity, within a chunk.
_MERGED = -1e100


class TangentsAndDivergence(eqx.Module, FieldAround):
    """A field for a state, its tangents, and the integral of the Jacobian's diagonal.

    The columns of its state (k, 1 + m + 1) are the motion, m tangents, and the integrals of the k
    diagonal entries of the Jacobian, whose sum is the integral of the divergence of the rate.

    Attributes:
      field: the motion with its tangents.
    """

    field: Variational

    def rate(self, t: Array, y: Array) -> Array:
        """Rates (k, 1 + m + 1) of all columns."""
        k = y.shape[0]
        # The unit vectors are further tangents at this time: one linearisation for all.
        rates = self.field.rate(t, jnp.concatenate([y[:, :-1], jnp.eye(k)], axis=1))
        diagonal = jnp.sum(rates[:, -k:] * jnp.eye(k), axis=1)
        return jnp.concatenate([rates[:, :-k], diagonal[:, None]], axis=1)

    @property
    def single(self) -> Any:
        """The field of the state alone."""
        return self.field.field

    @property
    def perturbed(self) -> list[tuple[Array, Array]]:
        """The perturbed numbers of the field: none."""
        return []

    def around(self, change: Callable, branch: Any) -> "TangentsAndDivergence":
        """The same columns of the field in a branch of its conditions; see `plan.branch`."""
        return TangentsAndDivergence(self.field.around(change, branch))

    def jump(self, t: Array, y: Array, old: Branch, new: Branch, which: Array) -> Array:
        """State and tangents after a switch; its stretching of volumes counts as divergence."""
        k = y.shape[0]
        columns = jnp.concatenate([y[:, :-1], jnp.eye(k)], axis=1)
        columns = self.field.jump(t, columns, old, new, which)
        # The saltation matrix is the identity with a matrix of rank one: det = 1 + its trace.
        factor = jnp.abs(1.0 + jnp.trace(columns[:, -k:] - jnp.eye(k)))
        merges = factor < _LOST
        stretched = jnp.where(merges, _MERGED, jnp.log(jnp.where(merges, 1.0, factor)))
        return jnp.concatenate([columns[:, :-k], y[:, -1:] + stretched / k], axis=1)

    def project(self, t: Array, y: Array) -> Array:
        """The state on its constraints, with its tangents along them."""
        return jnp.concatenate([self.field.project(t, y[:, :-1]), y[:, -1:]], axis=1)


class TangentState(NamedTuple):
    """A motion with its orthonormal tangents after a number of chunks.

    Attributes:
      y: (k,) state.
      frame: (k, m) orthonormal tangents, in the sizes of the entries.
      logs: (m,) logarithms of the factors by which they were stretched, summed.
      divergence: () integral of the divergence of the rate.
      steps: () accepted steps.
      status: () `Status` code of the last chunk.
      done: () number of chunks, as a float, since times are multiples of a chunk.
    """

    y: Array
    frame: Array
    logs: Array
    divergence: Array
    steps: Array
    status: Array
    done: Array


def tangent_state(y: Array, frame: Array, status: Array) -> TangentState:
    """The motion with its tangents before the first chunk."""
    return TangentState(
        y=y,
        frame=frame,
        logs=jnp.zeros(frame.shape[1]),
        divergence=jnp.zeros(()),
        steps=jnp.zeros((), int),
        status=status,
        done=jnp.zeros(()),
    )


def propagate_tangents(
    field,
    initial: TangentState,
    sizes: Array,
    t0: Array,
    chunk: Array,
    count: Array,
    limits: Limits,
    method: Method,
) -> TangentState:
    """The motion, of entries of sizes (k,), and its tangents after `count` equal chunks from t0.

    It stops at the first chunk that does not reach its end.
    """
    stretching = TangentsAndDivergence(Variational.of(field))

    def again(now: TangentState) -> Array:
        return (now.done < count) & (now.status == Status.OK)

    def advance(now: TangentState) -> TangentState:
        t = t0 + now.done * chunk
        frame = now.frame * sizes[:, None]
        y = jnp.concatenate([now.y[:, None], frame, jnp.zeros_like(now.y)[:, None]], axis=1)
        run = flow(stretching, y, t, t + chunk, jnp.zeros(0), limits, method=method)
        frame, factors = orthonormal(run.y1[:, 1:-1] / sizes[:, None])
        divergence = jnp.sum(run.y1[:, -1])
        merged = divergence < 0.5 * _MERGED
        lost = merged & ~(factors > _LOST).all() & (run.status == Status.OK)
        return TangentState(
            y=run.y1[:, 0],
            frame=frame,
            logs=now.logs + jnp.log(factors),
            divergence=now.divergence + jnp.where(merged, -jnp.inf, divergence),
            steps=now.steps + run.steps,
            status=jnp.where(lost, int(Status.MERGED), run.status),
            done=now.done + 1.0,
        )

    return jax.lax.while_loop(again, advance, initial)


def orthonormal(v: Array) -> tuple[Array, Array]:
    """Q (k, m) and the positive diagonal (m,) of R with v = Q R, without LAPACK.

    Args:
      v: (k, m) independent columns, m <= k.
    Example:
      >>> import jax.numpy as jnp
      >>> from jaxdyn.chaos.lyapunov import orthonormal
      >>> Q, r = orthonormal(jnp.array([[3.0, 1.0], [4.0, 0.0]]))
      >>> [round(float(x), 12) for x in r]
      [5.0, 0.8]
    """
    m = v.shape[1]

    def column(j, found):
        q, r = found
        here = jnp.arange(m) == j
        x = jax.lax.dynamic_index_in_dim(v, j, 1, keepdims=False)
        for _ in range(2):  # a single projection is not orthogonal for almost parallel columns
            shares = jnp.sum(q * x[:, None], axis=0)
            x = x - jnp.sum(q * shares[None, :], axis=1)
        length = jnp.sqrt(jnp.sum(x * x))
        return jnp.where(here[None, :], (x / length)[:, None], q), jnp.where(here, length, r)

    return jax.lax.fori_loop(0, m, column, (jnp.zeros_like(v), jnp.zeros(m)))


# ---- Lyapunov exponents as a result: means over parts of the time, their bars, and their checks

#: Number of parts of the time whose means are compared.
BATCHES = 32
#: Two-sided 95 % quantile of Student's t with BATCHES - 1 degrees of freedom.
_STUDENT = 2.04


class LyapunovSpectrum(Timed):
    """Lyapunov exponents, their error bars, and the sums that must hold.

    Attributes:
      exponents: (m,) exponents in the order of the tangents, which tends to descending order [1/s].
      bars: (m,) half-widths of 95 % intervals [1/s]; see `lyapunov_exponents`.
      batches: (BATCHES, m) means over equal parts of the time [1/s].
      divergence: () mean divergence of the rate along the motion [1/s], which is the sum of all
        exponents; minus infinity where nearby motions merge, as where dry friction stops them.
      trace_residual: () sum of all exponents minus `divergence` [1/s]: the error of the
        integration, not of the average; NaN for an incomplete spectrum.
      pairing_residual: () largest deviation of the sum of the i-th largest and the i-th smallest
        exponent from 2 `divergence` / k [1/s]. It is within the bars for Hamiltonian scenes, also
        with uniform damping (Dressler 1988), and has no meaning for others. It is an error of the
        integration alone if positions and momenta pair one by one in a constant symplectic form; if
        the form depends on the state, or pairs positions with each other, as in a rotating frame,
        it only tends to 0, as 1 / `time`. NaN for an odd or incomplete spectrum.
      dimension: () Kaplan-Yorke dimension [1]: that of the set on which the motion runs, if its
        volume neither grows nor shrinks; NaN if too few exponents are known.
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
        per, s = (self.in_units(unit) for unit in ("1/s", "s"))
        rows = [
            (f"exponent {i + 1}", f"{_text.brief(float(x))} +- {float(bar):.1e} {per}".rstrip())
            for i, (x, bar) in enumerate(zip(self.exponents, self.bars, strict=True))
        ]
        residuals = {"trace": self.trace_residual, "pairing": self.pairing_residual}
        known = [f"{name} {float(x):.1e}" for name, x in residuals.items() if not np.isnan(x)]
        dimension, bar = float(self.dimension), float(self.dimension_bar)
        others = [
            ("dimension", "" if np.isnan(dimension) else f"{_text.brief(dimension)} +- {bar:.1e}"),
            ("divergence", _text.brief(self.divergence, per)),
            ("residuals", f"{', '.join(known)} {per}" if known and per else ", ".join(known)),
            ("time", f"{_text.brief(self.time, s)}, in chunks of {_text.brief(self.chunk, s)}"),
            ("status", f"{Status(int(self.status)).name}: {self.message}"),
        ]
        return _text.table("LyapunovSpectrum", _text.shorten(rows) + others)

    _repr_html_ = _text.html

    @property
    def ok(self) -> bool:
        """Whether the motion reached its end; host only."""
        return int(self.status) == Status.OK

    @property
    def message(self) -> str:
        """How the integration ended, and the remedy; host only."""
        return Status(int(self.status)).message

    def as_dict(self) -> dict[str, Any]:
        """All numbers but the batches as lists, with None for what is not finite; host only."""
        names = (x.name for x in dataclasses.fields(self) if x.repr and x.name != "batches")
        return {name: _text.with_null(getattr(self, name)) for name in names}


def summary_of(batches: Array, divergence: Array, shear: Array, k: int) -> dict[str, Array]:
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

    Here j is the largest number of exponents whose sum is not negative. A sum within its own bar of
    zero counts as zero: that is the first exponent of a limit cycle, or the sum of all of a
    conservative scene.
    """
    exponents, bars = _mean(batches, shear)
    sums, sum_bars = _mean(jnp.cumsum(batches, axis=1), shear)
    nonnegative = sums >= -sum_bars
    j = jnp.sum(jnp.cumprod(nonnegative.astype(int)))
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


# ---- The exponents of a motion

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
      A motion that dry friction stops, or that slides along a surface, has exponents of minus
      infinity; where one of those is asked for, it ends with `Status.MERGED`.
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
    _checks.check_on_host("scene", (scene, t0, t1))
    left_out = _checked_transient(transient, float(t1 - t0))
    # One method, with its stages in a loop, for the motion with and without tangents: fast to
    # compile.
    method = check_method(scene, solver).for_tangents.in_loops(1)
    sizes = _pairing_sizes(scene, sizes_at_start(scene, t0, t1))
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
    return dataclasses.replace(found, time_unit=_text.second(scene.labels()))


def _checked_transient(transient, time: float) -> float:
    if time == 0:
        raise _checks.fail("t1", "an end after or before t0", "t0 itself")
    if transient is None:
        return _TRANSIENT * abs(time)
    left_out = float(_checks.array("transient", transient, ()))
    if not 0 < left_out < abs(time):
        wanted = f"between 0 and the time, {abs(time):g}"
        raise _checks.fail("transient", wanted, left_out, "It is a part of the time, left out.")
    return left_out


def _pairing_sizes(scene: Scene, sizes: np.ndarray) -> np.ndarray:
    """Sizes (k,) in which the entries of a constant symplectic form are 1.

    Exponents come in pairs in the limit of long times, whatever the sizes. In these sizes the form
    maps an orthonormal frame to another one, so that they do once the frame has aligned; in others
    the sums of pairs are off by the logarithm of a ratio of sizes, divided by the time.
    """
    form = invariant_form(scene, sizes)
    return sizes if form is None else sizes * balancing(np.abs(form))


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

    def carried(initial, t, time):
        """The tangents after a time from t, in a whole number of chunks."""
        count = jnp.ceil(time / length)
        chunk = direction * time / count
        return propagate_tangents(field, initial, sizes, t, chunk, count, limits, method)

    first = tangent_state(alone.y1, frame, alone.status)
    ready = carried(first, t0 + direction * half, half)
    time = jnp.abs(t1 - t0) - transient
    batch = time / BATCHES

    def one(now, i):
        t = t0 + direction * (transient + i * batch)
        end = carried(tangent_state(now.y, now.frame, now.status), t, batch)
        return end, (end.logs, end.divergence, end.steps)

    end, (logs, divergences, all_steps) = jax.lax.scan(one, ready, jnp.arange(float(BATCHES)))
    lost = end.status != Status.OK
    logs, divergences = (jnp.where(lost, jnp.nan, x) for x in (logs, divergences))
    shear = (jnp.log((transient + time) / transient) / time)[None]
    spectrum = summary_of(logs / batch, jnp.sum(divergences) / time, shear, len(y0))
    return LyapunovSpectrum(
        **spectrum,
        time=time,
        chunk=batch / jnp.ceil(batch / length),
        steps=jnp.sum(all_steps),
        status=end.status,
    )
