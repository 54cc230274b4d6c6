"""What effects share: the points that they act on, and the checks of their parameters."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.scene import Effect


def unless_zero(coefficient: Any, effect: Effect) -> tuple[Effect, ...]:
    """The effect as a tuple for a scene, or () if its coefficient is exactly 0.

    A scene without an effect compiles to a program without it. A traced coefficient keeps the
    effect, since its value is not known.
    Example:
      >>> from jaxdyn.effects import LinearDrag, unless_zero
      >>> unless_zero(0.0, LinearDrag(0.0))
      ()
    """
    absent = not _checks.is_traced(coefficient) and not np.any(np.asarray(coefficient))
    return () if absent else (effect,)


def at_least_zero(name: str, x: Array, remedy: str, n: int | None = None) -> None:
    """Raise ValueError unless a parameter, or each of n, is finite and not negative."""
    each = n is not None and np.ndim(x) == 1
    values = np.asarray(_checks.array(name, x, (n,) if each else (), remedy))
    if (values < 0).any():
        raise _checks.fail(name, ">= 0", values[values < 0].ravel()[0], remedy)


def vector_or_zero(name: str, x: Array, d: int) -> None:
    """Raise ValueError unless x is a vector (d,) or one number for all its components."""
    if np.ndim(x):
        _checks.array(name, x, (d,), "One component for each axis, or 0.")
    _checks.finite(name, x)


def point_number(name: str, i: int, n: int) -> None:
    """Raise ValueError unless i is the index of one of the n points of a system."""
    if not -n <= i < n:
        raise _checks.fail(name, f"a point from 0 to {n - 1}", i, "Points count from 0.")


def end_of(x: Array, j: int | None, anchor: Array) -> Array:
    """(d,) the entry of x (n, d) for point j, or the anchor where there is no point."""
    return jnp.broadcast_to(anchor, x.shape[1:]) if j is None else x[j]


def on_ends(force: Array, n: int, i: int, j: int | None) -> Array:
    """(n, d) the force (d,) on point i, its reaction on point j, and zero elsewhere."""
    weights = np.eye(n)[i] - (0.0 if j is None else np.eye(n)[j])
    return weights[:, None] * force[None, :]
