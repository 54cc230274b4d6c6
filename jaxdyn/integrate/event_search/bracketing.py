"""Whether a smooth function can cross zero between sample points.

Between two neighbouring samples the function is the cubic with its values and slopes there, up to
f'''' w^4 / 384 with w the width of the stretch. The size of f'''' follows from the differences of
the third derivatives of neighbouring cubics. A cubic lies in the hull of its four Bernstein
coefficients, and its slope in that of their differences. So a stretch is settled if the
coefficients stay clear of zero by more than the doubt, or are monotone, so that the values at the
ends decide. Other stretches have to be sampled more closely.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

#: Factor by which fourth derivatives may exceed the estimate from neighbouring cubics.
_SAFETY = 4.0
#: Error of a cubic with values and slopes at both ends: f'''' w^4 / 384 at most.
_CUBIC_ERROR_DIVISOR = 384.0


def are_settled(times: Array, g: Array, slope: Array, sides: Array, noise: Array) -> Array:
    """(s - 1, E) whether each of E functions crosses zero between samples only as its sides say.

    Args:
      times: (s,) times of the samples, increasing or decreasing; s > 2.
      g: (s, E) values.
      slope: (s, E) slopes in time.
      sides: (s, E) signs of the values; where a value is within rounding of zero, the sign before.
      noise: (s, E) values up to this are rounding.
    Limits: wrong for functions whose samples look smooth but which are not smooth in between.
    """
    width = jnp.diff(times)[:, None]
    parts = Stretch(g[:-1], g[1:], slope[:-1], slope[1:], width)
    between = 0.5 * (width[1:] + width[:-1])
    fourth = jnp.max(jnp.abs(jnp.diff(parts.third, axis=0) / between), axis=0)
    return parts.is_settled(fourth[None], sides[:-1], sides[1:], jnp.maximum(noise[:-1], noise[1:]))


class Stretch(NamedTuple):
    """Neighbouring samples of functions; all arrays of one shape.

    Attributes:
      g0: values at the first sample.
      g1: values at the second sample.
      slope0: slopes in time at the first sample.
      slope1: slopes at the second sample.
      width: the time between them, of either sign.
    """

    g0: Array
    g1: Array
    slope0: Array
    slope1: Array
    width: Array

    @property
    def third(self) -> Array:
        """The third derivative of the cubics."""
        rise = self.g1 - self.g0
        return (6 * self.width * (self.slope0 + self.slope1) - 12 * rise) / self.width**3

    def is_settled(self, fourth: Array, before: Array, after: Array, noise: Array) -> Array:
        """Whether the functions cross zero only as their sides tell.

        Args:
          fourth: size of the fourth derivatives.
          before: signs of the values at the first sample, see `are_settled`.
          after: signs at the second sample.
          noise: values up to this are rounding.
        """
        doubt = _SAFETY / _CUBIC_ERROR_DIVISOR * fourth * self.width**4
        d0, d1 = self.width * self.slope0, self.width * self.slope1
        b1, b2 = self.g0 + d0 / 3, self.g1 - d1 / 3
        middle = b2 - b1
        clear = (before == after) & (before * b1 > doubt) & (before * b2 > doubt)
        rises = (d0 >= -noise) & (middle > doubt) & (d1 >= -noise)
        falls = (d0 <= noise) & (middle < -doubt) & (d1 <= noise)
        largest = jnp.maximum(jnp.maximum(jnp.abs(b1), jnp.abs(b2)), doubt)
        largest = jnp.maximum(largest, jnp.maximum(jnp.abs(self.g0), jnp.abs(self.g1)))
        return clear | rises | falls | (largest <= noise)
