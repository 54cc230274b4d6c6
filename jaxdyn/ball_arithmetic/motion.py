"""Motions to any number of digits: Taylor series with estimated, not proved, truncation errors.

The order is proportional to the number of digits, and steps are those at which the last terms are
below the wanted error. Radii of rounding errors are dropped after each step: in interval arithmetic
they would grow as products of norms, much faster than errors do.
"""

import math
from typing import NamedTuple

from jaxdyn.ball_arithmetic import series
from jaxdyn.ball_arithmetic.arithmetic import arb, arb_mat, midpoints, precision
from jaxdyn.ball_arithmetic.field import BallField

#: Terms per digit. A step is then a seventh of the radius of convergence, at which a motion costs
#: least if its cost is proportional to the square of the order (Jorba, Zou 2005).
_ORDERS_PER_DIGIT = 1.15
_LEAST_ORDER = 12
_BITS_PER_DIGIT = math.log2(10)
_GUARD_BITS = 24
_STEP_SAFETY = 0.9  # safety factor of a step
_MOST_STEPS = 100_000


class End(NamedTuple):
    """The end of a motion.

    Attributes:
      y: (k) the state, as arb.
      slopes: (k, k) its derivative with respect to the start; None if not wanted.
      steps: number of steps.
    """

    y: list
    slopes: arb_mat | None
    steps: int


def bits_of(digits: float) -> int:
    """Bits of precision for a number of digits, with some to spare."""
    return math.ceil(digits * _BITS_PER_DIGIT) + _GUARD_BITS


def order_of(digits: float) -> int:
    """The order of series for a number of digits."""
    return max(_LEAST_ORDER, math.ceil(_ORDERS_PER_DIGIT * digits))


def follow(
    field: BallField,
    t: arb,
    y: list,
    span: arb,
    digits: float,
    *,
    slopes: bool = False,
    more_order: int = 0,
) -> End:
    """The end of the motion from y at t over a span > 0, to about a number of digits.

    Args:
      field: the rate.
      t: () the time of the start.
      y: (k) the start.
      span: () the length in time.
      digits: the truncation error of each step is below 10^-digits of the largest entry.
      slopes: whether to return the derivative with respect to the start.
      more_order: what is added to the order, for a second opinion with other steps.
    Raises:
      ArithmeticError: the motion runs into a singularity, or takes too many steps.
    """
    order = order_of(digits) + more_order
    with precision(bits_of(digits), order):
        product = None
        done, steps, last = arb(0), 0, False
        while not last:
            steps += 1
            coefficients = series.motion_series(field, t + done, y, order)
            h = _step(coefficients, digits)
            last = bool(done + h >= span)
            step = (span - done).mid() if last else arb(h)
            y = [series.at(row, step).mid() for row in coefficients]
            if not all(x.is_finite() for x in y) or not h > 0 or steps > _MOST_STEPS:
                raise ArithmeticError(
                    f"The motion cannot be followed beyond t = {float(done):.6g}."
                )
            if slopes:
                now = _transition(field, t + done, coefficients, step, order)
                product = now if product is None else midpoints(now * product)
            done = (done + step).mid()
        return End(y, product, steps)


def _step(coefficients: list[list], digits: float) -> float:
    """The step at which the last two terms are below the error."""
    order = len(coefficients[0]) - 1
    size = max(_log(row[0]) for row in coefficients)
    steps = []
    for n in (order - 1, order):
        last = max(_log(row[n]) for row in coefficients)
        if last > -math.inf:
            steps.append((size - digits * math.log(10) - last) / n)
    # For a polynomial, whose series ends, any step is right.
    return _STEP_SAFETY * math.exp(min(steps)) if steps else math.inf


def _log(x: arb) -> float:
    """The logarithm of |x|, also beyond the range of floats."""
    bound = abs(x.mid())
    return float(bound.log()) if not bound.is_zero() else -math.inf


def _transition(field, t, coefficients, h: arb, order: int) -> arb_mat:
    slopes = series.slope_series(field, t, coefficients, order)
    found = series.at(series.transition_series(slopes, order), h)
    return midpoints(found)
