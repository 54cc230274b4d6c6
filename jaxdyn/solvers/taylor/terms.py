"""What a step takes from the terms of its series: the sum, the error, how far it may go.

The terms are those of a proposed step. For a part z of it the term of order k is z^k times as
large, so how far the step may go is known before it is taken. A pair only learns from the error of
a step how long the next one may be, and by then the motion has changed: with its rule series took
10 to 30 % more steps for the same error (a spherical pendulum, a rigid body, Kepler's orbit), and
up to 5 % of them were rejected.
"""

import functools
from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn._numerics import rough_power
from jaxdyn.solvers.method import SAFETY
from jaxdyn.solvers.taylor.recurrences import Coefficient, plus, times

#: The estimate of the error in multiples of the last term. The error of a step is about the next
#: term, which is a few times smaller. But whoever asks for a tolerance by habit should not lose
#: digits: with this factor, errors of whole motions at one tolerance are no larger than those of a
#: pair in nine of ten runs (27 problems, tolerances of 1e-4 to 1e-13), and a sixteenth of them in
#: the median. At equal errors it costs nothing.
_CAUTION = 3.0
#: Weight of the difference of slopes at the end of a step, which also shows jumps within it: that
#: difference is already the next term, times the order.
_DEFECT_WEIGHT = 2.0
#: The part of it below this many roundings of the slope may be rounding, and gets this weight. The
#: weight is not zero, or steps would grow until they are rejected.
_ROUNDINGS, _ROUNDING_WEIGHT = 8.0, 0.25
#: Weight of the last term but one, in case the last one vanishes by symmetry. Successive terms
#: decrease by about this factor at the steps that tolerances lead to.
_LAST_BUT_ONE_WEIGHT = 0.1
#: Weight of each earlier term, in case both vanish: less than the ratio of terms, or these would
#: limit the steps of motions without such a symmetry (0.05 does, at rtol 1e-14).
_TERM_RATIO = 0.03


def increment(c: list[Coefficient], part: Array) -> Array:
    """The sum of all terms but the first at a part of the step.

    It is Horner's rule for every second term: one chain of all terms would take as long as the
    terms of a short formula, since nothing else is left to compute meanwhile.
    """
    square = part * part
    odd, even = (_polynomial(c[first::2], square) for first in (1, 2))
    found = [x for x in (times(odd, part), times(even, square)) if x is not None]
    return functools.reduce(jnp.add, found, jnp.zeros_like(part))


def _polynomial(c: list[Coefficient], z: Array) -> Coefficient:
    found = None
    for term in reversed(c):
        found = plus(term, times(found, z))
    return found


def slope(c: list[Coefficient], part: Array) -> Array:
    """The slope at a part of the step, times that part of the step."""
    return increment([None if x is None else np.float64(k) * x for k, x in enumerate(c)], part)


def last(c: list[Coefficient], part: Array) -> Array:
    """The last term at a part of the step. For all entries it is a direction of the error."""
    return _or_zero(times(c[-1], lax.integer_pow(part, len(c) - 1)))


def error(c: list[Coefficient], part: Array) -> Array:
    """The error at a part of the step: the sizes of terms that tell it, with the last's sign."""
    told = ((weight, times(c[k], lax.integer_pow(part, k))) for k, weight in _weights(len(c) - 1))
    sizes = (times(weight, jnp.abs(term)) for weight, term in told if term is not None)
    found = _or_zero(functools.reduce(plus, sizes, None))
    return jnp.where(_or_zero(c[-1]) < 0, -found, found)


def squares(series: list[list[Coefficient]], inverses: list[Array]) -> dict[int, Coefficient]:
    """Squares of the terms that tell the error, in tolerances, by order: means over all entries.

    Args:
      series: the terms of each entry.
      inverses: inverses of the error that each entry may have.
    """
    found = {}
    for k, weight in _weights(len(series[0]) - 1):
        scaled = (times(c[k], x) for c, x in zip(series, inverses, strict=True))
        total = functools.reduce(plus, (times(x, x) for x in scaled), None)
        found[k] = times(np.float64(weight * weight / len(series)), total)
    return found


def square_error(squares: dict[int, Coefficient], part: Array) -> Array:
    """() the square of the error of a part of the step, in tolerances."""
    z = part * part
    found = _polynomial([squares[k] for k in sorted(squares)], z)
    return _or_zero(times(found, lax.integer_pow(z, min(squares))))


def reach(squares: dict[int, Coefficient]) -> Array:
    """() the part of the step, or multiple of it, with an error well within the tolerance.

    It is found as if the error were proportional to the power of the part in the last term.
    """
    total = _or_zero(functools.reduce(plus, squares.values(), None))
    return SAFETY * rough_power(total, -0.5 / max(squares))


def _weights(order: int) -> Iterator[tuple[int, np.float64]]:
    """The orders of the terms that tell the error, and the weight of each.

    They are the last two and, in case these vanish by symmetry, earlier ones: terms of the second
    half count, since x'' = -x^7 from x = 0 has only every eighth one.
    """
    for k in range(order // 2 + 1, order + 1):
        before = order - 1 - k
        weight = 1.0 if before < 0 else _LAST_BUT_ONE_WEIGHT * _TERM_RATIO**before
        yield k, np.float64(_CAUTION * weight)


def _or_zero(x: Coefficient) -> Array:
    return jnp.zeros(()) if x is None else jnp.asarray(x)


def error_of_slopes(found: Array, expected: Array) -> Array:
    """The error from the difference of slopes, both times the step, with its signs."""
    apart, rounding = found - expected, _ROUNDINGS * jnp.finfo(found.dtype).eps * jnp.abs(found)
    small = jnp.clip(apart, -rounding, rounding)
    return _DEFECT_WEIGHT * (apart - small) + _ROUNDING_WEIGHT * small


def snap_to_number(reach: Array, t: Array, h: Array, inverse: Array) -> Array:
    """The part of a step from t, up to its reach, whose end is a floating-point number.

    Otherwise the state would belong to another time than the one noted, and the differences of the
    times of many steps, half a spacing each, would not be compensated.

    Args:
      reach: () how far the step may go, in parts of it.
      t: () start of the step.
      h: () the step, of either sign.
      inverse: 1 / h.
    """
    return jnp.where(reach < 1.0, ((t + reach * h) - t) * inverse, 1.0)
