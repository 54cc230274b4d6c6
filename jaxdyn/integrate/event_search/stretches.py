"""Whether a smooth function can cross zero between the places where it was looked at.

Between two neighbouring looks the function is the cubic with its values and slopes there, but for
f'''' w^4 / 384 with w the width of the stretch. How large f'''' is follows from how the third
derivatives of neighbouring cubics differ. A cubic lies in the hull of its four Bernstein
coefficients, and its slope in that of their differences. So a stretch is settled if the
coefficients stay clear of zero by more than the doubt, or if they only rise, or only fall, so
that the values at the ends tell all. Other stretches have to be looked at more closely.
"""

import jax.numpy as jnp
from jaxtyping import Array

#: Fourth derivatives may be so many times larger than the estimate from neighbouring cubics.
_SAFETY = 4.0
_CUBIC_ERROR_DIVISOR = (
    384.0  # error of a cubic with values and slopes at both ends: f'''' w^4 / 384 at most
)


def settled(times: Array, g: Array, slope: Array, sides: Array, noise: Array) -> Array:
    """(s - 1, E) whether each of E functions crosses zero between two looks as its sides say.

    Args:
      times: (s,) of the looks, rising or falling; s > 2.
      g: (s, E) values.
      slope: (s, E) slopes in time.
      sides: (s, E) signs of the values, and of those within rounding what they were before.
      noise: (E,) values up to this are rounding.
    Limits: functions whose values and slopes look smooth at all places and are not in between.
    """
    width = jnp.diff(times)[:, None]
    d0, d1, rise = width * slope[:-1], width * slope[1:], g[1:] - g[:-1]
    doubt = _doubt(width, d0, d1, rise)
    b1, b2 = g[:-1] + d0 / 3, g[1:] - d1 / 3
    s, middle, noise = sides[:-1], b2 - b1, noise[None]
    clear = (s == sides[1:]) & (s * b1 > doubt) & (s * b2 > doubt)
    rises = (d0 >= -noise) & (middle > doubt) & (d1 >= -noise)
    falls = (d0 <= noise) & (middle < -doubt) & (d1 <= noise)
    largest = jnp.maximum(jnp.maximum(jnp.abs(b1), jnp.abs(b2)), doubt)
    largest = jnp.maximum(largest, jnp.maximum(jnp.abs(g[:-1]), jnp.abs(g[1:])))
    return clear | rises | falls | (largest <= noise)


def _doubt(width: Array, d0: Array, d1: Array, rise: Array) -> Array:
    """(s - 1, E) how far the functions may be off their cubics."""
    third = (6 * (d0 + d1) - 12 * rise) / width**3
    between = 0.5 * (width[1:] + width[:-1])
    fourth = jnp.max(jnp.abs(jnp.diff(third, axis=0) / between), axis=0)
    return _SAFETY / _CUBIC_ERROR_DIVISOR * fourth[None] * width**4
