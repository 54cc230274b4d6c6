"""A search for zeros of a rate in a box, from many starts at once.

It makes Levenberg-Marquardt iterations in units of the box, and of the usual change of each rate
over it, and ends them with steps of Newton's method. An end counts as a zero only if the last
Newton step is short and the rate is small compared with its change over the box: a constant rate
has no zero, however small it is.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.scene import Field

_ITERATIONS = 80
_DAMPING = 1e-3  # initial damping, relative to the largest entry of J^T J
_LESS, _MORE = 0.2, 5.0  # factors of the damping after a successful step, and after a failed one
#: Number of the Newton steps that follow, and their largest length as a part of the box.
_NEWTON_STEPS, _LONGEST = 20, 0.25
#: Largest last Newton step, as a part of the box; largest rate, as a part of its change over it.
_CONVERGED = 1e-10
#: Smallest singular value of the Jacobian of an isolated zero, relative to its usual size.
_MIN_SINGULAR_VALUE = 1e-9
_FAR, _NEAR = 1e-4, 1e-6  # parts of the box: distances at which rates are compared to see a jump
_MAX_RATIO_NEAR_ZERO = 0.5  # of the rate near a zero to that far from it; it is larger at a jump


class Box(NamedTuple):
    """A box of states, low and high (k,); entries where both are equal are known."""

    low: np.ndarray
    high: np.ndarray

    @property
    def free(self) -> np.ndarray:
        """(n,) the unknown entries."""
        return np.flatnonzero(self.high > self.low)

    @property
    def axes(self) -> np.ndarray:
        """(k, n) columns: the edges of the box."""
        return np.diag(self.high - self.low)[:, self.free]

    def states(self, units: np.ndarray) -> np.ndarray:
        """(s, k) states of points (s, n) of the unit cube."""
        return self.low + units @ self.axes.T

    def units(self, ys: np.ndarray) -> np.ndarray:
        """(s, n) points of the unit cube of states (s, k)."""
        free = self.free
        return (ys[:, free] - self.low[free]) / (self.high - self.low)[free]

    def holds(self, ys: np.ndarray, slack: float) -> np.ndarray:
        """(s,) which states lie inside, up to a part of its size."""
        margin = slack * (self.high - self.low)
        with np.errstate(invalid="ignore"):
            return np.all((ys >= self.low - margin) & (ys <= self.high + margin), axis=1)


class SearchEnds(NamedTuple):
    """Where the iterations ended.

    Attributes:
      ys: (s, k) states.
      steps: (s,) size of a further Newton step, in units of the box.
      rates: (s,) largest entry of the rate.
      passed: (s,) whether it is a zero that satisfies the constraints.
      flat: (s,) whether the Jacobian is singular there.
      along: (s, k) the right singular vector of the Jacobian's least singular value.
    """

    ys: np.ndarray
    steps: np.ndarray
    rates: np.ndarray
    passed: np.ndarray
    flat: np.ndarray
    along: np.ndarray


def search(field: Field, t: Array, box: Box, ys: np.ndarray) -> SearchEnds:
    """The ends of iterations from states (s, k) in a box."""
    found = _search(field, t, jnp.asarray(box.axes), jnp.asarray(ys))
    return SearchEnds(*(np.asarray(x) for x in found))


@eqx.filter_jit
def _search(field: Field, t: Array, axes: Array, ys: Array) -> tuple[Array, ...]:
    def residual(y, units=1.0):
        """The rate, and the distance to the constraints, in units."""
        return jnp.concatenate([field.rate(t, y), field.project(t, y) - y]) / units

    def linearized(y, units=1.0):
        n = axes.shape[1]
        by_axes = jax.jacfwd(lambda x: residual(y + axes @ x, units))(jnp.zeros(n))
        return residual(y, units), by_axes

    rows = jax.vmap(lambda y: jnp.sum(jnp.abs(linearized(y)[1]), axis=1))(ys)
    usual = jnp.nanmedian(jnp.where(jnp.isfinite(rows), rows, jnp.nan), axis=0)
    usual = jnp.where(
        usual > 0, usual, jnp.nanmax(jnp.where(jnp.isfinite(rows), rows, 0.0), axis=0)
    )
    usual = jnp.where(usual > 0, usual, 1.0)

    def improve(_, carry):
        y, damping = carry
        f, a = linearized(y, usual)
        gram = a.T @ a
        weight = damping * (jnp.max(jnp.abs(gram)) + jnp.finfo(float).tiny)
        new = y - axes @ jnp.linalg.solve(gram + weight * jnp.eye(len(gram)), a.T @ f)
        better = jnp.sum(residual(new, usual) ** 2) < jnp.sum(f * f)  # False for NaN
        return jnp.where(better, new, y), damping * jnp.where(better, _LESS, _MORE)

    def go_on(carry):
        _, size, *_, steps = carry
        return (size > _CONVERGED) & (steps < _NEWTON_STEPS)

    def advance(carry):
        y, *_, steps = carry
        f, a = linearized(y)
        step, rows = _shortest_step(f, a)
        size = jnp.linalg.norm(step)
        y = y - axes @ (step * jnp.minimum(1.0, _LONGEST / jnp.maximum(size, _LONGEST)))
        return y, size, a, rows, steps + 1

    def end(y):
        y, _ = jax.lax.fori_loop(0, _ITERATIONS, improve, (y, jnp.asarray(_DAMPING)))
        # In a curved valley, such as a ring of equilibria of which a weak force leaves four, steps
        # that must lower the residual are short. Newton steps may leave the valley and return.
        none = jnp.zeros((len(usual), axes.shape[1])), jnp.zeros(len(usual))
        first = (y, jnp.asarray(jnp.inf), *none, 0)
        new, size, a, rows, _ = jax.lax.while_loop(go_on, advance, first)
        better = jnp.sum(residual(new, usual) ** 2) <= jnp.sum(residual(y, usual) ** 2)
        y = jnp.where(better, new, y)
        left = jnp.abs(residual(y))
        passed = (size <= _CONVERGED) & jnp.all(left <= _CONVERGED * rows)
        _, s, vt = jnp.linalg.svd(a / usual[:, None], full_matrices=False)
        flat = s[-1] <= _MIN_SINGULAR_VALUE * jnp.maximum(s[0], 1.0)
        return y, size, jnp.max(left[: len(y)]), passed, flat, axes @ vt[-1]

    return jax.vmap(end)(ys)


def _shortest_step(f: Array, a: Array) -> tuple[Array, Array]:
    """The Newton step (n,) of least norm, and the change of each residual over the box.

    It is computed from singular values, since the normal equations would square the condition
    number, and the matrix is singular on a curve of equilibria. Each row is in units of its change
    over the box.
    """
    rows = jnp.sum(jnp.abs(a), axis=1)
    units = jnp.where(rows > 0, rows, 1.0)
    u, s, vt = jnp.linalg.svd(a / units[:, None], full_matrices=False)
    kept = s > _MIN_SINGULAR_VALUE * s[0]
    step = vt.T @ (jnp.where(kept, 1 / jnp.where(kept, s, 1.0), 0.0) * (u.T @ (f / units)))
    return step, rows


def jumps(field: Field, t: Array, box: Box, ys: np.ndarray) -> np.ndarray:
    """(s,) whether the rate jumps at each of the zeros (s, k), as where a spring has length 0."""
    n = len(box.free)
    directions = (
        np.concatenate([np.eye(n), -np.eye(n), np.ones((1, n)), -np.ones((1, n))]) @ box.axes.T
    )
    far, near = (
        np.abs(rates(field, t, (ys[:, None] + part * directions).reshape(-1, ys.shape[1])))
        .reshape(len(ys), len(directions), ys.shape[1])
        .max(axis=1, initial=0.0)
        for part in (_FAR, _NEAR)
    )
    return (near > _MAX_RATIO_NEAR_ZERO * far).any(axis=1)


def rates(field: Field, t: Array, ys: np.ndarray) -> np.ndarray:
    """(s, k) rates at states (s, k)."""
    # States are padded to a power of two: each new number of them would recompile.
    room = 1 << max(len(ys) - 1, 0).bit_length()
    padded = np.concatenate([ys, np.zeros((room - len(ys), ys.shape[1]))])
    return np.asarray(_rates(field, t, jnp.asarray(padded)))[: len(ys)]


@eqx.filter_jit
def _rates(field: Field, t: Array, ys: Array) -> Array:
    return jax.vmap(lambda y: field.rate(t, y))(ys)


def low_discrepancy(n: int, d: int) -> np.ndarray:
    """(n, d) points that fill the unit cube evenly; deterministic.

    The additive sequence with the powers of 1/phi_d, where phi_d^(d+1) = phi_d + 1.

    Reference: Roberts (2018), The unreasonable effectiveness of quasirandom sequences.
    """
    phi = 2.0
    for _ in range(60):
        phi = (1 + phi) ** (1 / (d + 1))
    return (0.5 + np.arange(1, n + 1)[:, None] * phi ** -np.arange(1.0, d + 1)[None, :]) % 1.0
