"""Lyapunov exponents as a result: means over parts of the time, their bars, and their checks."""

import dataclasses
import math
from typing import Annotated, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn.status import Status
from jaxdyn.system import Record

#: Number of parts of the time whose means are compared.
BATCHES = 32
#: Two-sided 95 % quantile of Student's t with BATCHES - 1 degrees of freedom.
_STUDENT = 2.04


class LyapunovSpectrum(Record):
    """Lyapunov exponents, their error bars, and the sums that must hold.

    Attributes:
      exponents: (m,) exponents in the order of the tangents, which tends to descending order [1/s].
      bars: (m,) half-widths of 95 % intervals [1/s]; see `lyapunov_exponents`.
      batches: (BATCHES, m) means over equal parts of the time [1/s].
      divergence: () mean divergence of the rate along the motion [1/s], which is the sum of all
        exponents.
      trace_residual: () sum of all exponents minus `divergence` [1/s]: the error of the
        integration, not of the average; NaN for an incomplete spectrum.
      pairing_residual: () largest deviation of the sum of the i-th exponent from above and the i-th
        from below from its value 2 `divergence` / k [1/s]. It is within the bars for Hamiltonian
        scenes, also with uniform damping (Dressler 1988), and has no meaning for others. NaN for an
        odd or incomplete spectrum.
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
        rows = [
            (f"exponent {i + 1}", f"{_text.brief(float(x))} +- {float(bar):.1e}")
            for i, (x, bar) in enumerate(zip(self.exponents, self.bars, strict=True))
        ]
        residuals = f"trace {float(self.trace_residual):.1e}"
        if not np.isnan(self.pairing_residual):
            residuals += f", pairing {float(self.pairing_residual):.1e}"
        dimension, bar = float(self.dimension), float(self.dimension_bar)
        rows += [
            ("dimension", f"{_text.brief(dimension)} +- {bar:.1e}"),
            ("divergence", _text.brief(self.divergence)),
            ("residuals", residuals),
            ("time", f"{_text.brief(self.time)}, in chunks of {_text.brief(self.chunk)}"),
            ("status", f"{Status(int(self.status)).name}: {self.message}"),
        ]  # fmt: skip
        return _text.table("LyapunovSpectrum", _text.shorten(rows[:-5]) + rows[-5:])

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
        names = (field.name for field in dataclasses.fields(self))
        return {name: _text.with_null(getattr(self, name)) for name in names if name != "batches"}


def judge(batches: Array, divergence: Array, shear: Array, k: int) -> dict[str, Array]:
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
