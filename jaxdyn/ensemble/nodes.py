"""An event at the nodes of a lane, and where it is zero between two of them."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

_GUESSES = 5  # Newton steps for the zero of the polynomial through the ends of a step


class Node(NamedTuple):
    """The event at a time of the run."""

    t: Array  # () in the direction of the run
    g: Array  # () value
    slope: Array  # () of the value in that time
    side: Array  # () its sign, 0 where rounding decides
    noise: Array  # () values up to this are rounding


def zero_between(before: Node, here: Node, end: Node) -> Array:
    """() time after `here` of the zero between it and `end` of the quintic through all three.

    Newton's interpolation with double nodes; its zero by Newton's method within the bracket.
    """
    x = [node.t - here.t for node in (before, before, here, here, end, end)]
    table = [node.g for node in (before, before, here, here, end, end)]
    slopes = [node.slope for node in (before, here, end)]
    coefficients = [table[0]]
    for order in range(1, 6):
        table = [
            slopes[i // 2]
            if order == 1 and i % 2 == 0
            else (table[i + 1] - table[i]) / (x[i + order] - x[i])
            for i in range(6 - order)
        ]
        coefficients.append(table[0])
    h = end.t - here.t

    def newton(_, s):
        value, slope = coefficients[-1], jnp.zeros_like(s)
        for c, node in zip(coefficients[-2::-1], x[4::-1], strict=True):
            value, slope = c + (s - node) * value, value + (s - node) * slope
        new = s - value / jnp.where(slope == 0, 1.0, slope)
        return jnp.where((new > 0) & (new < h), new, 0.5 * s)

    first = h * here.g / jnp.where(here.g == end.g, 1.0, here.g - end.g)
    first = jnp.where((first > 0) & (first < h), first, 0.5 * h)
    for i in range(_GUESSES):
        first = newton(i, first)
    return first
