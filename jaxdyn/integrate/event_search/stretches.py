"""Whether a smooth function can cross zero between sample points.

Between two neighbouring samples the function is the cubic with its values and slopes there, up to
f'''' w^4 / 384 with w the width of the stretch. The size of f'''' follows from the differences of
the third derivatives of neighbouring cubics. A cubic lies in the hull of its four Bernstein
coefficients, and its slope in that of their differences. So a stretch is settled if the
coefficients stay clear of zero by more than the doubt, or are monotone, so that the values at the
ends decide. Other stretches have to be sampled more closely.
"""

import jax.numpy as jnp
from jaxtyping import Array

#: Factor by which fourth derivatives may exceed the estimate from neighbouring cubics.
_SAFETY = 4.0
#: Error of a cubic with values and slopes at both ends: f'''' w^4 / 384 at most.
_CUBIC_ERROR_DIVISOR = 384.0


def settled(times: Array, g: Array, slope: Array, sides: Array, noise: Array) -> Array:
    """(s - 1, E) whether each of E functions crosses zero between samples only as its sides say.

    Args:
      times: (s,) of the samples, increasing or decreasing; s > 2.
      g: (s, E) values.
      slope: (s, E) slopes in time.
      sides: (s, E) signs of the values; where a value is within rounding of zero, the sign before.
      noise: (E,) values up to this are rounding.
    Limits: wrong for functions whose samples look smooth but which are not smooth in between.
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
    """(s - 1, E) bound on the distance of the functions from their cubics."""
    third = (6 * (d0 + d1) - 12 * rise) / width**3
    between = 0.5 * (width[1:] + width[:-1])
    fourth = jnp.max(jnp.abs(jnp.diff(third, axis=0) / between), axis=0)
    return _SAFETY / _CUBIC_ERROR_DIVISOR * fourth[None] * width**4
