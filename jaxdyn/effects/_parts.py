"""What effects share: the points that they act on, and the checks of their parameters."""

import functools
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
    _checks.at_least_zero(name, _checks.array(name, x, (n,) if each else (), remedy), remedy)


def vector_or_zero(name: str, x: Array, d: int) -> None:
    """Raise ValueError unless x is a vector (d,) or one number for all its components."""
    if np.ndim(x):
        _checks.array(name, x, (d,), "One component for each axis, or 0.")
    _checks.finite(name, x)


def point_number(name: str, i: int, n: int) -> None:
    """Raise ValueError unless i is the index of one of the n points of a system."""
    if not is_index(i, n):
        raise _checks.fail(name, f"a point from 0 to {n - 1}", i, "Points count from 0.")


def is_index(i: Any, n: int) -> bool:
    """Whether i is the index of one of n things, which may count from the end."""
    whole = isinstance(i, int | np.integer) and not isinstance(i, bool)
    return whole and -n <= int(i) < n


def end_of(x: Array, j: int | None, anchor: Array) -> Array:
    """(d,) the entry of x (n, d) for point j, or the anchor where there is no point."""
    return jnp.broadcast_to(anchor, x.shape[1:]) if j is None else x[j]


def on_ends(force: Array, n: int, i: int, j: int | None) -> Array:
    """(n, d) the force (d,) on point i, its reaction on point j, and zero elsewhere."""
    weights = _one_of("i", i, n) - (0.0 if j is None else _one_of("j", j, n))
    return weights[:, None] * force[None, :]


def _one_of(name: str, i: int, n: int) -> Any:
    point_number(name, i, n)  # a traced call comes here before `check`
    return np.eye(n)[i]


#: Number of terms that a point sums at once; a point with more of them sums parts of them first.
_WIDTH = 8


def sums_at(x: Array, points: tuple[int, ...], n: int) -> Array:
    """(n, d) at each of n points the sum of the rows of x (e, d) that belong to it.

    Each point gathers its rows: a scatter adds them one by one and takes twice as long.

    Args:
      x: the rows.
      points: the point of each row.
      n: number of points.
    """
    for rows in _tables(points, n):
        none = jnp.zeros_like(x[:1])
        x = jnp.sum(jnp.concatenate([x, none])[rows], axis=0)
    return x


@functools.lru_cache(maxsize=32)
def _tables(points: tuple[int, ...], n: int) -> list[np.ndarray]:
    """Tables of the rows to sum at each point; first those of partial sums, if rows are many.

    Returns:
      Tables (w, m), each with the indices of the w rows that make up each of m sums. The rows are
      the sums of the table before; the index after the last row stands for no row.
    """
    found = []
    ends = np.asarray(points)
    ends = np.where(ends < 0, ends + n, ends)
    while True:
        order = np.argsort(ends, kind="stable")
        ends = ends[order]
        rank = np.arange(len(ends)) - np.searchsorted(ends, ends)  # among those of the point
        final = rank.max() < _WIDTH
        if final:
            part, count = ends, n
        else:
            _, part = np.unique(ends * len(ends) + rank // _WIDTH, return_inverse=True)
            count = part.max() + 1
        table = np.full((min(rank.max() + 1, _WIDTH), count), len(ends))
        table[rank % _WIDTH, part] = order
        found.append(table)
        if final:
            return found
        sums = np.empty(count, int)
        sums[part] = ends
        ends = sums
