"""Interval arithmetic: bounds of results, from the bounds of the operands.

There are two instances, with the same rules. `RIGOROUS`, on the host in NumPy, widens each result
by its rounding, so that bounds hold for real numbers; only underflow is left out. `COMPILED`,
within programs of JAX, leaves rounding out: its bounds decide where steps end, not what is proved.

An infinite bound encloses finite numbers only, so 0 times it is 0. Division by an interval with 0
in its interior gives the whole line, and so does any unknown result, such as infinity minus
infinity. Bounds may be wide, since correlations are ignored: x - x over [0, 1] is [-1, 1]. They
shrink in proportion to the intervals.

Reference: Moore, Kearfott, Cloud (2009), Introduction to Interval Analysis.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

ROUNDING = 2.0**-52  # relative error of one operation, and of the product that widens its result
FUNCTION_ROUNDING = 2.0**-50  # relative error of an elementary function, 4 units in the last place


class Interval(NamedTuple):
    """Numbers between low and high, arrays of one shape. Those of a condition are 0 and 1."""

    low: Any
    high: Any


def point(x) -> Interval:
    """The intervals of known numbers."""
    return Interval(x, x)


def negative(a: Interval) -> Interval:
    """Bounds of minus a number."""
    return Interval(-a.high, -a.low)


@dataclasses.dataclass(frozen=True)
class Arithmetic:
    """The operations on intervals, in one library of arrays.

    Attributes:
      xp: `numpy` or `jax.numpy`.
      rounds: whether results are widened by their rounding.
    """

    xp: Any
    rounds: bool

    def widen(self, low, high, by: float = ROUNDING) -> Interval:
        """Bounds widened by rounding; NaN, as of infinity minus infinity, becomes no bound."""
        xp = self.xp
        if self.rounds:
            low, high = low - by * xp.abs(low), high + by * xp.abs(high)
        return Interval(
            xp.where(xp.isnan(low), -math.inf, low), xp.where(xp.isnan(high), math.inf, high)
        )

    def add(self, a: Interval, b: Interval) -> Interval:
        """Bounds of a sum."""
        return self.widen(a.low + b.low, a.high + b.high)

    def multiply(self, a: Interval, b: Interval) -> Interval:
        """Bounds of a product."""
        xp = self.xp
        corners = [xp.where((x == 0) | (y == 0), 0.0, x * y) for x in a for y in b]
        low = xp.minimum(xp.minimum(corners[0], corners[1]), xp.minimum(corners[2], corners[3]))
        high = xp.maximum(xp.maximum(corners[0], corners[1]), xp.maximum(corners[2], corners[3]))
        return self.widen(low, high)

    def scale(self, factor: float, a: Interval) -> Interval:
        """The result of `multiply` by a known number, in a fifth of the time."""
        ends = a if factor >= 0 else a[::-1]
        return self.widen(*(factor * x for x in ends))

    def inverse(self, a: Interval) -> Interval:
        """Bounds of 1 / a: one where 0 is an end of a, as for a distance; none if 0 is inside."""
        xp = self.xp
        low, high = (1 / xp.where(x == 0, 1.0, x) for x in (a.high, a.low))
        has_low = ((a.low >= 0) & (a.high > 0)) | (a.high < 0)
        has_high = ((a.low < 0) & (a.high <= 0)) | (a.low > 0)
        return self.widen(xp.where(has_low, low, -math.inf), xp.where(has_high, high, math.inf))

    def whole_power(self, a: Interval, n: int) -> Interval:
        """Bounds of a^n, n not 0; an even power is not negative."""
        if n < 0:
            return self.inverse(self.whole_power(a, -n))
        xp, ends = self.xp, (a.low**n, a.high**n)
        low, high = ends
        if n % 2 == 0:
            low, high = xp.minimum(*ends), xp.maximum(*ends)
            low = xp.where((a.low < 0) & (a.high > 0), 0.0, low)
        return self.widen(low, high, n * FUNCTION_ROUNDING)

    def real_power(self, a: Interval, n: Interval | float) -> Interval:
        """Bounds of a^n for a not negative; the whole line where a may be negative."""
        xp, powers = self.xp, n if isinstance(n, Interval) else (n,)
        ends = [x**y for x in a for y in powers]
        low, high = ends[0], ends[0]
        for x in ends[1:]:
            low, high = xp.minimum(low, x), xp.maximum(high, x)
        unknown = a.low < 0
        low, high = xp.where(unknown, -math.inf, low), xp.where(unknown, math.inf, high)
        return self.widen(low, high, FUNCTION_ROUNDING)

    def hull(self, a: Interval, b: Interval) -> Interval:
        """Bounds of a number that is in one of two intervals."""
        return Interval(self.xp.minimum(a.low, b.low), self.xp.maximum(a.high, b.high))

    def magnitude(self, a: Interval) -> Interval:
        """Bounds of the absolute value."""
        xp, ends = self.xp, (self.xp.abs(a.low), self.xp.abs(a.high))
        inside = (a.low < 0) & (a.high > 0)
        return Interval(xp.where(inside, 0.0, xp.minimum(*ends)), xp.maximum(*ends))

    def rising(self, fn: Callable, a: Interval) -> Interval:
        """Bounds of an increasing function; infinite ones where it is undefined."""
        return self.widen(fn(a.low), fn(a.high), FUNCTION_ROUNDING)

    def root(self, a: Interval) -> Interval:
        """Bounds of the square root, where it is defined."""
        xp = self.xp
        return self.rising(xp.sqrt, Interval(xp.maximum(a.low, 0.0), a.high))

    def cosine(self, a: Interval, shift: float) -> Interval:
        """Bounds of cos(a - shift pi), shift 0 or 1/2: 1 at even multiples of pi, -1 at odd."""
        xp = self.xp
        ends = [xp.cos(x) if shift == 0 else xp.sin(x) for x in a]
        low, high = self.widen(xp.minimum(*ends), xp.maximum(*ends), FUNCTION_ROUNDING)
        first, last = self._half_turns(a, shift)
        high = xp.where(2 * xp.floor(last / 2) >= first, 1.0, high)
        low = xp.where(2 * xp.floor((last - 1) / 2) + 1 >= first, -1.0, low)
        unknown = ~(xp.isfinite(first) & xp.isfinite(last))
        return Interval(
            xp.where(unknown, -1.0, xp.maximum(low, -1.0)),
            xp.where(unknown, 1.0, xp.minimum(high, 1.0)),
        )

    def tangent(self, a: Interval) -> Interval:
        """Bounds of the tangent; none where it has a pole."""
        xp = self.xp
        first, last = self._half_turns(a, -0.5)
        unknown = xp.floor(first) != xp.floor(last)
        low, high = self.rising(xp.tan, a)
        return Interval(xp.where(unknown, -math.inf, low), xp.where(unknown, math.inf, high))

    def _half_turns(self, a: Interval, shift: float) -> Interval:
        """a / pi - shift, widened; this may only add a multiple of pi to the interval."""
        low, high = (x / math.pi - shift for x in a)
        first, last = self.widen(low, high, 8 * FUNCTION_ROUNDING)
        slack = FUNCTION_ROUNDING if self.rounds else 0.0
        return Interval(first - slack, last + slack)

    # Conditions: 1 and 1 where they surely hold, 0 and 0 where they surely do not.

    def less(self, a: Interval, b: Interval) -> Interval:
        """Whether a < b, or a <= b."""
        return self._truth(a.high < b.low, a.low <= b.high)

    def equal(self, a: Interval, b: Interval) -> Interval:
        """Whether a == b."""
        surely = (a.low == b.high) & (a.high == b.low)
        return self._truth(surely, (a.low <= b.high) & (b.low <= a.high))

    def _truth(self, surely, maybe) -> Interval:
        return Interval(*(self.xp.where(x, 1.0, 0.0) for x in (surely, maybe)))

    def opposite(self, a: Interval) -> Interval:
        """Whether a condition does not hold."""
        return Interval(1.0 - a.high, 1.0 - a.low)

    def both(self, a: Interval, b: Interval) -> Interval:
        """Whether two conditions hold."""
        return Interval(*map(self.xp.minimum, a, b))

    def either(self, a: Interval, b: Interval) -> Interval:
        """Whether one of two conditions holds."""
        return Interval(*map(self.xp.maximum, a, b))

    def choose(self, which: Interval, no: Interval, yes: Interval) -> Interval:
        """Bounds of one of two numbers, chosen by a condition."""
        xp, never, always = self.xp, which.high == 0, which.low == 1
        cases = zip(no, yes, self.hull(no, yes), strict=True)
        return Interval(*(xp.where(never, a, xp.where(always, b, c)) for a, b, c in cases))


RIGOROUS = Arithmetic(np, rounds=True)
COMPILED = Arithmetic(jnp, rounds=False)
