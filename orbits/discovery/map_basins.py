"""Basins of attraction of a map: which fixed point, cycle or chaotic attractor a start approaches.

The map is a function of a state (k,), such as a step of Newton's method or a return map; all starts
are iterated at once. Where they end, a cycle is searched for by Newton's method on y - f^p(y), and
verified by its multipliers, the eigenvalues of the derivative of f^p; a chaotic attractor by a
positive Lyapunov exponent.
"""

import functools
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._records import captures
from jaxdyn.files.rows import Rows, program_text, rows_in
from jaxdyn.formulations.functions import as_params, call, check_function, vector
from jaxdyn.system import check_value
from orbits.discovery.settling import (
    CHAOTIC,
    CHUNK,
    CONTRACTS,
    CYCLE,
    FIXED,
    LAYOUT,
    NEWTON,
    REACHED,
    Attractor,
    Basins,
    Settling,
    as_axes,
    check_rounds,
    over_grid,
)
from orbits.discovery.workers import pack, unpack

_PERIODS = 32  # longest cycle that is searched for
_RETURNS = 4  # return times that are tried as the period
_STEPS = 20  # steps of Newton's method for a cycle
_EXACT = 1e-9  # largest closing error of a cycle, relative to the sizes
_CLOUD = 20_000  # points of a chaotic attractor
_BLOCKS = 20  # blocks of steps; the spread of their exponents gives the error bar
_BAR = 2.1  # standard errors of their mean in a 95 % interval: Student's t
_FAR = 1e8  # relative to the largest entry of the grid: a start diverges beyond


def map_basins(
    step: Callable,
    grid: Mapping[str, Any],
    *,
    params: Any = None,
    steps: int = 200,
    rounds: int = 3,
    refine: int = 0,
    path: str | Path | None = None,
    executor: Executor | None = None,
) -> Basins:
    """The basins of attraction of a map over a grid of starts.

    Args:
      step: a function of the state (k,), and of `params` if there are any, that returns the next
        state, an array of `jax.numpy` or a list of k numbers.
      grid: values of all entries of the state by name, in their order, an array (n,) for each; all
        combinations are iterated.
      params: any pytree of numbers; new values do not compile again.
      steps: number of steps of a round.
      rounds: largest number of rounds for starts that have not yet reached an attractor.
      refine: see `basins`.
      path: see `basins`.
      executor: see `basins`.
    Returns:
      Labels, verified attractors, fractions with bars. Starts that diverge or become NaN have the
      label -1.
    Raises:
      ValueError: `step` is not such a function or returns another shape, a number is out of range,
        or see `basins` on grids and files.
    Limits: attractors that no start of the grid reaches, cycles longer than 32 and quasi-periodic
      motions are not recognised.
    Example:
      >>> import orbits, numpy as np
      >>> def newton(y):  # for z^2 = 1
      ...     square = y[0] ** 2 + y[1] ** 2
      ...     return [0.5 * (y[0] + y[0] / square), 0.5 * (y[1] - y[1] / square)]
      >>> side = np.linspace(-1.9, 1.9, 20)
      >>> found = orbits.map_basins(newton, {"x": side, "y": side})
      >>> sorted(a.points[0].round(9).tolist() for a in found.attractors), found.fractions[2]
      ([[-1.0, 0.0], [1.0, 0.0]], np.float64(0.0))
    """
    _checks.check_on_host("map_basins", params)
    params = as_params(params)
    check_function("step", step, params, "y")
    captures("step", step)
    axes = as_axes(grid)
    check_rounds(rounds, refine, axes)
    _checks.whole("steps", steps)
    largest = max(float(np.abs(x).max()) for x in axes.values())
    iterated = _Map(step, params)
    y = jnp.zeros(len(axes))
    check_value("step", y.shape, "One number for each entry of the grid.", iterated, y)
    entries, start = list(range(len(axes))), np.zeros(len(axes))
    title, far = _text.name_of(step, "a map"), _FAR * max(largest, 1.0)
    of = (
        program_text(lambda params, y: _Map(step, params)(y), params, y),
        params,
        axes,
        steps,
        rounds,
        refine,
    )
    with rows_in(path, LAYOUT, of, CHUNK, executor) as kept:
        settling = _Iterates(iterated, steps, rounds, len(axes), far, kept)
        return over_grid(settling, axes, start, entries, refine, scene=None, title=title)


class _Map(eqx.Module):
    """A function of the user with its parameters."""

    function: Callable = eqx.field(static=True)
    params: Any

    def __call__(self, y: Array) -> Array:
        return vector("step", call(self.function, self.params, y), y)

    def times(self, y: Array, count: int) -> Array:
        """(k,) the state after the given number of steps."""
        return jax.lax.fori_loop(0, count, lambda _, y: self(y), y)


@eqx.filter_jit
def _after(step: _Map, ys: Array, count: int) -> Array:
    return jax.vmap(lambda y: step.times(y, count))(ys)


@eqx.filter_jit
def _path(step: _Map, y: Array, count: int) -> Array:
    """(count, k) the states from y on."""
    return jax.lax.scan(lambda y, _: (step(y), y), y, length=count)[1]


@eqx.filter_jit
def _close_cycle(step: _Map, y: Array, period: int) -> tuple[Array, Array]:
    """The point of a cycle near y, and (k, k) the derivative of the map over the period there."""

    def over(y):
        return jax.lax.scan(lambda y, _: (step(y), None), y, length=period)[0]

    def newton(_, y):
        slope = jax.jacfwd(over)(y)
        return y - jnp.linalg.solve(slope - jnp.eye(len(y)), over(y) - y)

    y = jax.lax.fori_loop(0, _STEPS, newton, y)
    return y, jax.jacfwd(over)(y)


@eqx.filter_jit
def _exponents(step: _Map, y: Array, count: int) -> tuple[Array, Array]:
    """(count, k) states and logarithms of the growth along each direction, step by step."""

    def one(carry, _):
        y, frame = carry
        frame, growth = jnp.linalg.qr(jax.jacfwd(step)(y) @ frame)
        size = jnp.maximum(jnp.abs(jnp.diag(growth)), jnp.finfo(float).tiny)
        return (step(y), frame), (y, jnp.log(size))

    return jax.lax.scan(one, (y, jnp.eye(len(y))), length=count)[1]


def _states_after(step: _Map, count: int, far: float, y0s: np.ndarray) -> np.ndarray:
    """(n, k) states at the end of a round from these starts; an executor may call this."""
    ys = np.asarray(_after(unpack(step), jnp.asarray(y0s), count))
    return np.where((np.abs(ys) < far).all(axis=1, keepdims=True), ys, np.nan)


class _Iterates(Settling):
    """The iterates of a map."""

    tries = 60  # each takes milliseconds

    def __init__(self, step: _Map, steps: int, rounds: int, k: int, far: float, kept: Rows):
        super().__init__(steps, rounds, k, kept)
        self.step, self.far = step, far

    @property
    def ends(self):
        return functools.partial(_states_after, pack(self.step), self.span, self.far)

    def largest(self, y0s):
        sizes = np.abs(y0s).max(axis=0, initial=0.0)
        return np.where(sizes > 0, sizes, 1.0)

    def difference(self, ys, y):
        return ys - y[None]

    def wrap(self, ys):
        return ys

    def attractor(self, y, last):
        path = np.asarray(_path(self.step, jnp.asarray(y), _PERIODS + 1))
        back = 1 + np.flatnonzero(self.apart(path[1:], y) < REACHED)
        for period in back[:_RETURNS].tolist():
            point, slope = map(np.asarray, _close_cycle(self.step, jnp.asarray(y), period))
            cycle = np.asarray(_path(self.step, jnp.asarray(point), period + 1))
            if not (np.isfinite(slope).all() and self.apart(cycle[-1:], point)[0] < _EXACT):
                continue
            multipliers = np.abs(np.linalg.eigvals(slope))
            if self.apart(point[None], y)[0] < NEWTON and multipliers.max() < 1:
                known = [one for one in self.attractors if one.kind in (FIXED, CYCLE)]
                if any(self.is_near(one, point[None])[0] for one in known):
                    return None  # a known cycle that the start still approaches
                sizes = np.maximum(multipliers, np.finfo(float).tiny)
                exponents = np.sort(np.log(sizes) / period)[::-1]
                kind = FIXED if period == 1 else CYCLE
                return Attractor(kind, cycle[:-1], None, exponents, np.zeros(len(exponents)))
        return self._chaotic(y) if last else None

    def _chaotic(self, y: np.ndarray) -> Attractor | None:
        y = self.beside(y)
        points, growth = map(np.asarray, _exponents(self.step, jnp.asarray(y), _CLOUD))
        if not (np.abs(points) < self.far).all():
            return None
        blocks = growth.reshape(_BLOCKS, -1, growth.shape[1]).mean(axis=1)
        exponents = blocks.mean(axis=0)
        bars = _BAR * blocks.std(axis=0, ddof=1) / np.sqrt(_BLOCKS)
        # Where volumes are preserved, nothing attracts; in a map that folds they may grow.
        kept = abs(exponents.sum()) <= CONTRACTS * np.abs(exponents).max()
        if not exponents[0] - bars[0] > np.finfo(float).eps or (kept and len(exponents) > 1):
            return None
        return Attractor(CHAOTIC, points, None, exponents, bars)
