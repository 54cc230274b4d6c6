"""Interval arithmetic: rigorous bounds of numbers, including rounding.

Every result is widened by its rounding, so the bounds hold for real numbers; underflow alone is
not accounted for. An infinite bound encloses finite numbers only, so 0 times it is 0. A division
by an interval that contains 0 gives the whole line, and so does any unknown result.

Reference: Moore, Kearfott, Cloud (2009), Introduction to Interval Analysis.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

ROUNDING = 2.0**-52  # relative error of one operation, and of the product that widens its result
FUNCTION_ROUNDING = 2.0**-50  # relative error of an elementary function, 4 units in the last place


class Interval(NamedTuple):
    """Numbers between low and high, arrays of one shape."""

    low: np.ndarray
    high: np.ndarray


def point(x: np.ndarray) -> Interval:
    """The intervals of known numbers."""
    return Interval(x, x)


def _widen(low: np.ndarray, high: np.ndarray, by: float = ROUNDING) -> Interval:
    """Bounds widened by rounding; NaN, as of infinity times 0, becomes no bound."""
    low, high = low - by * np.abs(low), high + by * np.abs(high)
    return Interval(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))


def add(a: Interval, b: Interval) -> Interval:
    """Bounds of a sum."""
    return _widen(a.low + b.low, a.high + b.high)


def negative(a: Interval) -> Interval:
    """Bounds of minus a number."""
    return Interval(-a.high, -a.low)


def multiply(a: Interval, b: Interval) -> Interval:
    """Bounds of a product."""
    # 0 times infinity is 0 here: an infinite bound encloses finite numbers only.
    corners = [np.where((x == 0) | (y == 0), 0.0, x * y) for x in a for y in b]
    low = np.minimum(np.minimum(corners[0], corners[1]), np.minimum(corners[2], corners[3]))
    high = np.maximum(np.maximum(corners[0], corners[1]), np.maximum(corners[2], corners[3]))
    return _widen(low, high)


def inverse(a: Interval) -> Interval:
    """Bounds of 1 / a, the whole line where a may have either sign."""
    inside = (a.low <= 0) & (a.high >= 0)
    low, high = np.where(inside, -np.inf, 1 / a.high), np.where(inside, np.inf, 1 / a.low)
    # The bound is one-sided where 0 is an end, as for a distance.
    high = np.where((a.low > 0) | (a.high < 0), high, np.inf)
    low = np.where((a.low == 0) & (a.high > 0), 1 / a.high, low)
    high = np.where((a.high == 0) & (a.low < 0), 1 / a.low, high)
    return _widen(low, high)


def whole_power(a: Interval, n: int) -> Interval:
    """Bounds of a^n, n > 0; an even power is not negative."""
    low, high = a.low**n, a.high**n
    if n % 2 == 0:
        low, high = np.minimum(low, high), np.maximum(low, high)
        low = np.where((a.low < 0) & (a.high > 0), 0.0, low)
    return _widen(low, high, n * FUNCTION_ROUNDING)


def hull(a: Interval, b: Interval) -> Interval:
    """Bounds of a number that is in one of two intervals."""
    return Interval(np.minimum(a.low, b.low), np.maximum(a.high, b.high))


def rising(fn: Callable, a: Interval) -> Interval:
    """Bounds of an increasing function; none where it is undefined."""
    return _widen(fn(a.low), fn(a.high), FUNCTION_ROUNDING)


def cosine(a: Interval, shift: float) -> Interval:
    """Bounds of cos(a - shift pi), shift 0 or 1/2: 1 at even multiples of pi, -1 at odd ones."""
    ends = [np.cos(x) if shift == 0 else np.sin(x) for x in a]
    low, high = _widen(np.minimum(*ends), np.maximum(*ends), FUNCTION_ROUNDING)
    # These count half turns, widened: an extra multiple of pi only makes bounds wider.
    first, last = _widen(a.low / np.pi - shift, a.high / np.pi - shift, 8 * FUNCTION_ROUNDING)
    first, last = first - FUNCTION_ROUNDING, last + FUNCTION_ROUNDING
    high = np.where(2 * np.floor(last / 2) >= first, 1.0, high)
    low = np.where(2 * np.floor((last - 1) / 2) + 1 >= first, -1.0, low)
    unknown = ~(np.isfinite(first) & np.isfinite(last))
    return Interval(
        np.where(unknown, -1.0, np.maximum(low, -1.0)),
        np.where(unknown, 1.0, np.minimum(high, 1.0)),
    )


def by_number(factor: float, a: Interval) -> Interval:
    """The result of `multiply` by a known number, in a fifth of the time."""
    ends = a if factor >= 0 else a[::-1]
    return _widen(*(factor * x for x in ends))


def real_power(a: Interval, n: float) -> Interval:
    """Bounds of a^n for a not negative; the whole line where a may be negative."""
    ends = a.low**n, a.high**n
    low, high = np.minimum(*ends), np.maximum(*ends)
    unknown = a.low < 0
    low, high = np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high)
    return _widen(low, high, FUNCTION_ROUNDING)
