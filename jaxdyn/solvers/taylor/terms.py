"""What a step takes from the terms of its series: the sum, the error, how far it may go.

The terms are those of a proposed step. For a part z of it the term of order k is z^k times as
large, so how far the step may go is known before it is taken. A pair only learns from the error of
a step how long the next one may be, and by then the motion has changed: with its rule series took
10 to 30 % more steps for the same error (a spherical pendulum, a rigid body, Kepler's orbit), and
up to 5 % of them were rejected.
"""

import functools

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn._numerics import rough_power
from jaxdyn.solvers.method import SAFETY
from jaxdyn.solvers.taylor.recurrences import Coefficient, plus, times

#: The estimate in parts of the last term. The error of a step is about the next term, a few times
#: smaller. But who asks for a tolerance by habit should not lose digits: so errors of whole motions
#: at one tolerance are no larger than those of a pair in nine of ten runs (16 problems, tolerances
#: of 1e-4 to 1e-13), and a twentieth of them in the median. At equal errors it costs nothing.
_CAUTION = 3.0
#: The difference of slopes at the end of a step, which also shows jumps within it, in parts of the
#: last term: it is the next term already, times the order.
_DEFECT_WEIGHT = 2.0
#: The part of it below so many roundings of the slope may be rounding, and counts less; but not
#: nothing, or steps would grow until they are rejected.
_ROUNDINGS, _ROUNDING_WEIGHT = 8.0, 0.25
#: Weight of the last term but one, in case the last one vanishes by symmetry. Successive terms
#: decrease by about this factor at the steps that tolerances lead to.
_LAST_BUT_ONE_WEIGHT = 0.1
#: Weight of each earlier term, in case both vanish: less than the factor between terms, or these
#: would limit the steps of motions without such a symmetry (0.05 does, at rtol 1e-14).
_TERM_RATIO = 0.03


def increment(c: list[Coefficient], part: Array) -> Array:
    """The sum of all terms but the first at a part of the step.

    By Horner's rule for every second term: one chain of all terms would take as long as the terms
    of a short formula, since nothing else is left to compute meanwhile.
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
    """The slope there, times that part of the step."""
    return increment([None if x is None else np.float64(k) * x for k, x in enumerate(c)], part)


def error(c: list[Coefficient], part: Array) -> Array:
    """The error at a part of the step: the size of the last two terms, with the last one's sign.

    Extrapolated from earlier ones where symmetry hides them: terms of the second half count, since
    x'' = -x^7 from x = 0 has every eighth one only. By their signs the errors of all entries are a
    direction.
    """
    order = len(c) - 1
    found = jnp.zeros_like(part)
    for k in range(order // 2 + 1, order + 1):
        before = order - 1 - k
        weight = 1.0 if before < 0 else _LAST_BUT_ONE_WEIGHT * _TERM_RATIO**before
        if c[k] is not None:
            term = weight * jnp.abs(c[k]) * lax.integer_pow(part, k)
            found = _larger(found, term) if before > 0 else found + term
    last = c[order]
    return _CAUTION * (found if last is None else jnp.where(last < 0, -found, found))


def error_of_slopes(found: Array, expected: Array) -> Array:
    """The error from the difference of slopes, both times the step, with its signs."""
    apart, rounding = found - expected, _ROUNDINGS * jnp.finfo(found.dtype).eps * jnp.abs(found)
    small = jnp.clip(apart, -rounding, rounding)
    return _DEFECT_WEIGHT * (apart - small) + _ROUNDING_WEIGHT * small


def allowed_part(errors: list[Array], weights: list[Array], order: int) -> Array:
    """() the part of the step with an error well within the tolerance, at most 1.

    Args:
      errors: those of the whole step.
      weights: inverse of the error that each entry may have.
      order: the power of the part to which errors are proportional, if the last term is theirs.
    """
    relative = (e * w for e, w in zip(errors, weights, strict=True))
    total = functools.reduce(jnp.add, (x * x for x in relative))
    part = SAFETY * rough_power(total * np.float64(1.0 / len(errors)), -0.5 / order)
    return jnp.where(part < 1.0, part, 1.0)


def ending_at_a_number(part: Array, t: Array, h: Array, inverse: Array) -> Array:
    """The part of a step from t whose end is a floating-point number.

    Otherwise the state would be that of another time than the one noted, and the difference of the
    times of many steps, half a spacing each, would not be compensated.

    Args:
      part: at most 1.
      t: () start of the step.
      h: () the step, of either sign.
      inverse: 1 / h.
    """
    return jnp.where(part < 1.0, ((t + part * h) - t) * inverse, 1.0)


def _larger(a: Array, b: Array) -> Array:
    return jnp.where(a > b, a, b)
