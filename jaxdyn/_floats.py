"""Numbers as float arrays, the leaves of a scene: whole numbers and lists would be others."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array


def as_float(x: Any) -> Array:
    """A number or numbers as a float array; the converter of fields that hold them."""
    return jnp.asarray(x, dtype=float)


def floats(*numbers: Any) -> tuple[Array, ...]:
    """Each of some numbers as a float array."""
    return tuple(map(as_float, numbers))
