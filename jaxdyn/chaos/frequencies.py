"""Frequency analysis of a motion: its samples as a sum of few oscillations (NAFF).

A quasi-periodic signal is f(t) = sum of a_j exp(i w_j t), where each w_j is a combination of few
basic frequencies. The largest oscillation is where the windowed Fourier integral

    A(w) = 1/T  integral of f(t) exp(-i w t) chi(t) dt

is largest. It is found on the grid of a fast Fourier transform, refined by Newton's method, and
subtracted; all oscillations found so far are then refined together, by Newton's method on their
joint least-squares problem, since each disturbs the others. Laskar's window
chi = c_p (1 + cos(pi s))^p, s in [-1, 1], makes the disturbance by oscillations that are not
subtracted decrease like T^-(2p + 2).
"""

import math

import numpy as np

from jaxdyn import _checks, _text
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.system import Record

#: Power of the window; 1 is Hann's.
WINDOW = 3
#: Default number of oscillations.
COUNT = 10
_LEAST_SAMPLES = 16
_ROUNDS = 8  # rounds of Newton's method, which converges quadratically
_APART = 2.0  # distance, in 2 pi / T, below which two frequencies are not distinguished
_PADDING = 4  # factor of the transform's length, whose grid then brackets each maximum
_FAINT = 1e-14  # amplitude, as a share of the largest, that may be only rounding
_EQUALLY_SPACED = 1e-9  # relative scatter of time steps that is rounding


class Frequencies(Record):
    """A signal as the sum of amplitude * exp(i frequency t), strongest first.

    Attributes:
      frequencies: (m,) angular frequencies [rad/s]; for a real signal the positive ones and 0.
      bars: (m,) their uncertainty [rad/s]: the change with a weaker window, and the possible shift
        by the rest of the signal. Errors of the samples that look like oscillations are not
        included.
      amplitudes: (m,) complex, at t = 0 in the times of the samples, in the unit of the signal; a
        real signal is the real part of the sum.
      residual: () largest difference of the signal from the sum, relative to the largest sample:
        large for chaotic signals, and where `count` was too small.
    """

    frequencies: np.ndarray
    bars: np.ndarray
    amplitudes: np.ndarray
    residual: float

    __repr__ = _text.fields
    _repr_html_ = _text.html


def frequencies(
    signal: "Trajectory | np.ndarray", entry=None, *, dt=None, count: int = COUNT
) -> Frequencies:
    """The frequencies of a motion, by numerical analysis of fundamental frequencies (NAFF).

    Args:
      signal: a motion with equally spaced samples, or samples (n,), real or complex. A complex
        signal such as q - i p / w shows the sense of rotation, and has half as many oscillations.
        For a rotating angle use exp(i angle).
      entry: name of the entry of the state to analyse; for a motion only.
      dt: () time between samples [s]; for samples only.
      count: largest number of oscillations; there are fewer if the rest is rounding.
    Returns:
      Frequencies, amplitudes, uncertainties, and the residual.
    Raises:
      ValueError: fewer than 16 samples, samples that are not finite or not equally spaced, no such
        entry, or `dt` missing or not positive.
    Limits: host only. It needs two samples in the shortest period, and a time span of some ten of
      the longest periods, in which oscillations of close frequencies get out of phase by two turns.
    Reference: Laskar (1990), Icarus 88, 266; Laskar (2003), arXiv:math/0305364; Gomez, Mondelo &
      Simo (2010), Discrete Contin. Dyn. Syst. B 14, 41 (joint refinement).
    Example:
      >>> import numpy as np
      >>> from jaxdyn import chaos
      >>> t = np.linspace(0.0, 200.0, 2001)
      >>> found = chaos.frequencies(np.cos(t) + 0.3 * np.sin(np.sqrt(2.0) * t), dt=0.1, count=2)
      >>> bool(abs(found.frequencies - [1.0, np.sqrt(2.0)]).max() < 1e-12)
      True
    """
    ts, values = _samples(signal, entry, dt)
    _checks.whole("count", count)
    real, middle = not np.iscomplexobj(values), 0.5 * (ts[0] + ts[-1])
    t, scale = ts - middle, float(np.abs(values).max())
    if t[-1] < 0:  # a motion backwards in time: its samples are put in the order of time
        t, values = t[::-1], values[::-1]
    if scale == 0.0:
        nothing = np.zeros(0)
        return Frequencies(nothing, nothing, nothing.astype(complex), 0.0)
    w, a = _lines(t, values.astype(complex) / scale, count, real)
    weaker, _ = _refine(t, values / scale, w, WINDOW - 1)
    rest = np.abs(values / scale - _sum(t, w, a)).max()
    eps = np.finfo(float).eps
    bars = (
        np.abs(weaker - w) + (rest + eps) / (t[-1] * np.maximum(np.abs(a), _FAINT)) + eps * abs(w)
    )
    if real:
        kept = w >= 0
        w, bars, a = w[kept], bars[kept], np.where(w == 0, 1.0, 2.0)[kept] * a[kept]
    order = np.argsort(-np.abs(a))
    at_zero = scale * a * np.exp(-1j * w * middle)
    return Frequencies(w[order], bars[order], at_zero[order], float(rest))


def _samples(signal, entry, dt) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and values (n,), checked."""
    _checks.check_on_host("signal", (signal, dt))
    if isinstance(signal, Trajectory):
        names = [name for name, _ in signal.scene.labels()]
        _checks.choice("entry", entry, names)
        ts, values = np.asarray(signal.ts), np.asarray(signal[entry])
        steps = np.diff(ts)
        if len(ts) > 1 and np.ptp(steps) > _EQUALLY_SPACED * abs(ts[-1] - ts[0]):
            raise _checks.fail("signal", "equally spaced samples", "others", "Pass their number.")
    else:
        if entry is not None:
            raise _checks.fail("entry", "none for samples", repr(entry), "Pass the samples alone.")
        values = np.asarray(signal)
        if dt is None:
            raise _checks.fail("dt", "the time between samples", "none")
        ts = np.arange(values.size) * float(_checks.positive("dt", dt, "It is a time."))
    if values.ndim != 1 or len(values) < _LEAST_SAMPLES:
        wanted = f"at least {_LEAST_SAMPLES} samples in a row"
        raise _checks.fail("signal", wanted, f"shape {values.shape}")
    if not np.isfinite(values).all():
        raise _checks.fail("signal", "finite samples", "NaN or infinity")
    return ts, values


def _window(t: np.ndarray, power: int) -> np.ndarray:
    return (1.0 + np.cos(np.pi * t / t[-1])) ** power


def _lines(t: np.ndarray, f: np.ndarray, count: int, real: bool) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and amplitudes of the strongest oscillations; pairs +-w for a real signal."""
    w, a = np.zeros(0), np.zeros(0, complex)
    for _ in range(count):
        found, size = _strongest(t, f - _sum(t, w, a), w)
        if size < _FAINT:
            break
        near_zero = abs(found) < math.pi / (t[-1] - t[0])
        new = [0.0] if real and near_zero else [found, -found] if real else [found]
        w, a = _refine(t, f, np.concatenate([w, new]), WINDOW)
    return w, a


def _strongest(t: np.ndarray, rest: np.ndarray, known: np.ndarray) -> tuple[float, float]:
    """The frequency where the windowed transform of the rest is largest, and that maximum.

    Frequencies near known ones are left out; the maximum is 0 where none is left.
    """
    chi = _window(t, WINDOW)
    n, h = _PADDING * len(t), t[1] - t[0]
    size = np.abs(np.fft.fft(chi * rest, n)) / chi.sum()
    grid = 2 * math.pi * np.fft.fftfreq(n, h)
    # A frequency that is found again is only the remainder of its own error.
    near = np.abs(grid[:, None] - known[None]) < _APART * 2 * math.pi / abs(t[-1] - t[0])
    taken = near.any(axis=1)
    if taken.all():
        return 0.0, 0.0
    i = int(np.argmax(np.where(taken, 0.0, size)))
    low, mid, high = np.log(np.maximum(size[[i - 1, i, (i + 1) % n]], np.finfo(float).tiny))
    curvature = low - 2 * mid + high
    shift = 0.5 * (low - high) / curvature if curvature < 0 else 0.0
    return float(grid[i] + np.clip(shift, -1, 1) * (grid[1] - grid[0])), float(size[i])


def _refine(
    t: np.ndarray, f: np.ndarray, w: np.ndarray, power: int
) -> tuple[np.ndarray, np.ndarray]:
    """All frequencies and amplitudes, by Newton's method on their weighted least squares.

    In f = sum of (a + b t) exp(i w t), the unknowns b are i a dw to first order in the change dw.
    """
    weight = np.sqrt(_window(t, power))[:, None]
    for _ in range(_ROUNDS):
        waves = weight * np.exp(1j * t[:, None] * w[None])
        columns = np.concatenate([waves, waves * (t / t[-1])[:, None]], axis=1)
        found = np.linalg.lstsq(columns, weight[:, 0] * f, rcond=None)[0]
        a, b = np.split(found, 2)
        fixed = (w == 0) | (np.abs(b) > np.abs(a))  # a mean; or a step that is too long
        change = np.where(fixed, 0.0, (b / np.where(a == 0, 1.0, a)).imag / t[-1])
        w = w + change
        if np.abs(change).max() <= np.finfo(float).eps * max(np.abs(w).max(), 1 / t[-1]):
            break
    waves = weight * np.exp(1j * t[:, None] * w[None])
    return w, np.linalg.lstsq(waves, weight[:, 0] * f, rcond=None)[0]


def _sum(t: np.ndarray, w: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.exp(1j * t[:, None] * w[None]) @ a
