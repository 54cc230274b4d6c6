"""The complete elliptic integral of the first kind, which gives periods in closed form."""

import math

_MEANS = 12  # iterations: once close, each doubles the number of correct digits


def complete(other: float) -> float:
    """K for a complementary modulus k' = sqrt(1 - k^2), from an arithmetic-geometric mean.

    Example:
      >>> complete(1.0) == math.pi / 2
      True
    """
    mean = 1.0
    for _ in range(_MEANS):
        mean, other = (mean + other) / 2, math.sqrt(mean * other)
    return math.pi / 2 / mean
