"""A motion cut into segments, each with its own initial state, for multiple shooting.

Over one long segment the misfit of an oscillation has a local minimum for each period by which it
may be out of phase, and that of a chaotic motion has innumerable ones. Therefore each segment is so
short that it depends almost linearly on its initial state and the parameters; a constraint makes
the end of each segment the start of the next (Bock, H. G., 1983, Recent advances in parameter
identification techniques for O.D.E.; for chaos Baake, Baake, Bock and Briggs, 1992, Phys. Rev. A
45, 5524).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.fitting.measurements import Column, Measured
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Scene

_RAD = "rad"
#: Samples of a segment, and the largest number of segments by default.
_SAMPLES, _MOST = 10, 64


class Segments(NamedTuple):
    """The table in m segments of at most n times, padded with the last time.

    Attributes:
      begin: (m,) times at which segments begin.
      end: (m,) times at which they end.
      ts: (m, n) measured times.
      values: (m, n, c) measured values; 0 for gaps.
      there: (m, n, c) 1 for measured values, 0 for gaps.
    """

    begin: Array
    end: Array
    ts: Array
    values: Array
    there: Array


def cut(table: Measured, t0: float, count: int | None) -> Segments:
    """The table in segments, the first of which begins at t0."""
    if count is None:
        count = min(max(len(table.ts) // _SAMPLES, 1), _MOST)
    begin = np.array([part[0] for part in np.array_split(table.ts, count)])
    begin[0] = t0
    end = np.append(begin[1:], max(table.ts[-1], t0))
    ts, known = in_segments(table.ts, count, np.nan), np.isfinite(table.values)
    ts = np.where(np.isnan(ts), end[:, None], ts)
    values = in_segments(np.where(known, table.values, 0.0), count)
    there = in_segments(known, count)
    return Segments(*map(jnp.asarray, (begin, end, ts, values, there)))


def in_segments(rows: np.ndarray, count: int, filling: float = 0.0) -> np.ndarray:
    """(m, n, ...) rows (s, ...) of a table in segments, with a number in place of missing ones."""
    parts = np.array_split(rows, count)
    found = np.full((count, len(parts[0]), *rows.shape[1:]), filling)
    for i, part in enumerate(parts):
        found[i, : len(part)] = part
    return found


def in_rows(values: np.ndarray, count: int) -> np.ndarray:
    """(s, ...) the rows of a table from their segments (m, n, ...)."""
    parts = np.array_split(np.arange(count), len(values))
    return np.concatenate([rows[: len(part)] for rows, part in zip(values, parts, strict=True)])


class Model(eqx.Module):
    """The map from unknowns to measured quantities; static except for numbers within `rest`.

    Attributes:
      make: function of the parameters that returns the scene.
      by_name: whether it takes them as keywords.
      tree: structure of the parameters.
      shapes: shapes of its leaves.
      rest: leaves of the parameters that are not numbers.
      columns: the measured quantities.
      free: whether each entry of the initial state is estimated; others are those of the scene.
      options: options of `solve`.
    """

    make: Callable = eqx.field(static=True)
    by_name: bool = eqx.field(static=True)
    tree: Any = eqx.field(static=True)
    shapes: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    rest: Any
    columns: tuple[Column, ...] = eqx.field(static=True)
    free: tuple[bool, ...] = eqx.field(static=True)
    options: tuple[tuple[str, Any], ...] = eqx.field(static=True)

    def params(self, theta: Array) -> Any:
        """The parameters, in the structure of the guess, from a flat vector (p,)."""
        sizes = [int(np.prod(shape)) for shape in self.shapes]
        parts = jnp.split(theta, np.cumsum(sizes)[:-1]) if sizes else []
        leaves = [x.reshape(shape) for x, shape in zip(parts, self.shapes, strict=True)]
        return eqx.combine(jax.tree.unflatten(self.tree, leaves), self.rest)

    def as_given(self, theta: Any) -> Any:
        """The parameters from a flat vector (p,), with single numbers as floats, on the host."""
        params = self.params(jnp.asarray(theta))
        return jax.tree.map(lambda x: float(x) if eqx.is_array(x) and x.ndim == 0 else x, params)

    def scene(self, theta: Array) -> Scene:
        """The scene for a flat vector (p,) of parameters."""
        params = self.params(theta)
        return self.make(**params) if self.by_name else self.make(params)

    def run(self, theta: Array, start: Array, begin, end, ts, columns=None):
        """The measured quantities (n, c) at times ts (n,) of a motion, and its end (k,)."""
        scene = self.scene(theta).starting(start)
        out = solve(scene, end, t0=begin, ts=ts, **dict(self.options))
        seen = self.columns if columns is None else columns

        def see(t, y):
            return jnp.stack([column.value(scene, t, y) for column in seen])

        return jax.vmap(see)(ts, out.ys), out.y1

    @property
    def angles(self) -> tuple[bool, ...]:
        """Whether each column is an angle of the state."""
        return tuple(c.unit == _RAD and c.entry is not None for c in self.columns)

    def misfit(self, seen: Array, values: Array) -> Array:
        """Computed minus measured values (..., c); angles differ by at most half a turn."""
        angles = np.array(self.angles)
        d = seen - values
        if not angles.any():
            return d
        angles = np.broadcast_to(angles, d.shape)
        return jnp.where(angles, (d + jnp.pi) % (2 * jnp.pi) - jnp.pi, d)
