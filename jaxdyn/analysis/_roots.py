"""Zeros of many functions of one variable at once, each kept in its bracket."""

from collections.abc import Callable

import numpy as np

_LAST_STEP = 1e-9  # convergence is superlinear: after a step this small only rounding remains
_LONGEST_SECANT = 1e-6  # a longer secant may be far from the slope at its ends
_ITERATIONS = 40


def root(
    fn: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) zeros of functions between low (n,) and high (n,), and whether each was found.

    It is Newton's method safeguarded by the bracket; where the slope is NaN, it takes the secant
    through the last two points. Where the new point is outside the bracket, or the last step did
    not halve the value, it bisects.

    Args:
      fn: (n,) points -> (n,) values and (n,) slopes.
      low: lower ends.
      high: upper ends.
    """
    value_low, _ = fn(low)
    value_high, slope = fn(high)
    sign_low = np.sign(value_low)  # a product of two values may overflow
    good = sign_low * value_high <= 0
    x, value, old_x, old_value = high, value_high, low, value_low
    settled = ~good
    for _ in range(_ITERATIONS):
        with np.errstate(divide="ignore", invalid="ignore"):
            secant = (value - old_value) / (x - old_x)
            new = x - value / np.where(np.isnan(slope), secant, slope)
        quick = (np.abs(value) <= 0.5 * np.abs(old_value)) & (new >= low) & (new <= high)
        new = np.where(quick, new, 0.5 * (low + high))
        tolerance = _LAST_STEP * (1 + np.abs(x))
        close = np.abs(new - x) <= tolerance
        # Between values that differ by orders of magnitude a secant step is tiny, as if it had
        # converged. A probe at the distance of the tolerance shows whether it has.
        trusted = ~np.isnan(slope) | (np.abs(x - old_x) <= _LONGEST_SECANT * (1 + np.abs(x)))
        doubtful = quick & close & ~trusted
        probe = np.where(
            sign_low * value > 0, np.minimum(x + tolerance, high), np.maximum(x - tolerance, low)
        )
        new = np.where(doubtful, probe, new)
        new = np.where(settled | (value == 0), x, new)
        settled = settled | (close & ~doubtful) | (new == x)
        old_x, old_value, x = x, value, new
        value, slope = fn(x)
        left = sign_low * value > 0
        low, high = np.where(left, x, low), np.where(left, high, x)
        if settled.all():
            break
    good = good & settled & np.isfinite(value)
    return np.where(good, x, np.nan), good
