"""Radau IIA collocation: an L-stable implicit pair for stiff scenes.

s stages at the Radau nodes give order 2 s - 1; parts of the motion that are much faster than a
step are damped instead of limiting it (Hairer, Wanner, Solving Ordinary Differential Equations II,
IV.8). With Z_i = Y_i - y the equations Z = h A F(y + Z) are solved by simplified Newton
iterations: one Jacobian per step. The eigenvectors of A split the system of s k unknowns into
(s + 1) / 2 systems of k unknowns, one real and the others complex, inverted without LAPACK.
Iterations continue until rounding stops them. The last change of one that has not converged counts
as error, so its step is rejected like one that is too long; that of one that has converged is
rounding, which shorter steps do not reduce.
"""

import dataclasses
import functools
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.solvers.gauss import collocation, mix
from jaxdyn.solvers.method import Advance, Method, Rate

_MAX_ITERATIONS = 25  # most Newton iterations
_CONVERGED = 4.5  # relative change, in roundings, below which an iteration has converged


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Radau(Method):
    """Radau IIA collocation with an embedded formula for its error.

    Attributes:
      name: its name in reports.
      c: (s,) nodes, the last of them 1.
      a: (s, s) stage weights; the last row is that of the solution.
    """

    name: str
    c: np.ndarray
    a: np.ndarray
    adaptive: ClassVar[bool] = True
    position_only: ClassVar[bool] = False
    stable: ClassVar[float] = np.inf
    several: ClassVar[bool] = False

    @property
    def order(self) -> int:
        """Order of the solution."""
        return 2 * self.stages - 1

    @property
    def error_order(self) -> int:
        """The embedded formula has order s."""
        return self.stages + 1

    @property
    def damps(self) -> bool:
        """It is L-stable."""
        return True

    @property
    def stages(self) -> int:
        """Right-hand sides per Newton iteration."""
        return len(self.c)

    @functools.cached_property
    def _decoupled(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(m,) eigenvalues of a, real one first, (m, s) and (s, m) maps to their systems and back.

        There is one of each complex pair; twice its real part is the contribution of both.
        """
        values, vectors = np.linalg.eig(self.a)
        inverse = np.linalg.inv(vectors)
        kept = [i for i in np.argsort(np.abs(values.imag)) if values[i].imag >= -1e-12]
        count = np.where(np.abs(values[kept].imag) > 1e-12, 2.0, 1.0)
        return values[kept], inverse[kept], vectors[:, kept] * count

    @functools.cached_property
    def _embedded_weights(self) -> tuple[float, np.ndarray]:
        """gamma and (s,) weights e: the error is (1 - h gamma J)^-1 (h gamma f(y) + e Z)."""
        gamma = self._decoupled[0][0].real
        powers = np.arange(self.stages)[:, None]
        moments = 1.0 / (powers[:, 0] + 1.0)
        moments[0] -= gamma
        other = np.linalg.solve(self.c**powers, moments)
        return gamma, (other - self.a[-1]) @ np.linalg.inv(self.a)

    def advance(self, field: Rate, t: Array, h: Array, y: Array) -> Advance:
        fields = jax.vmap(field, in_axes=(0, -1), out_axes=-1)  # stages last
        times = t + h * self.c
        values, to, back = self._decoupled
        kind = jnp.result_type(complex)
        inverses = _inverses(jnp.asarray(values) * h.astype(kind), _jacobian(field, t, y))

        def solved(right):
            """(1 - h a x J)^-1 applied to right sides (k, ..., s)."""
            right = right.astype(kind)
            decoupled = [mix(row[None], right)[..., 0] for row in to]
            found = [_apply(m, x) for m, x in zip(inverses, decoupled, strict=True)]
            return jnp.stack([_weighted_sum(found, row).real for row in back], axis=-1)

        rounding = jnp.finfo(y.dtype)

        def again(carry):
            n, z, _, change, _ = carry
            f = fields(times, y[..., None] + z)
            residual = z - h * mix(self.a, f)
            dz = -solved(residual)
            size = (
                jnp.abs(y)[..., None] + jnp.max(jnp.abs(z), axis=-1, keepdims=True) + rounding.tiny
            )
            return n + 1, z + dz, dz[..., -1], jnp.max(jnp.abs(dz) / size), change

        def go_on(carry):
            n, _, _, change, before = carry
            return (
                (n < _MAX_ITERATIONS)
                & (change > _CONVERGED * rounding.eps)
                & ((n < 3) | (change < before))
            )

        far = jnp.full((), jnp.inf, y.dtype)
        z = jnp.zeros((*y.shape, self.stages), y.dtype)
        start = 0, z, jnp.zeros_like(y), far, far
        _, z, last, change, _ = jax.lax.while_loop(go_on, again, start)
        missed = jnp.where(change > _CONVERGED * rounding.eps, jnp.abs(last), 0.0)
        gamma, e = self._embedded_weights
        raw = h * gamma * field(t, y) + mix(e[None], z)[..., 0]
        error = _apply(inverses[0].real, raw)
        return Advance(z[..., -1], jnp.abs(error) + missed)


def _jacobian(field: Rate, t: Array, y: Array) -> Array:
    """(k, k) Jacobian of the state, even where tangents are integrated with it."""
    place = [(0, 0, 0)] + [(0, n - 1, 0) for n in y.shape[1:]]

    def rate(x):
        # The state is the first column, whose rate does not depend on the others.
        whole = jax.lax.pad(x.reshape(-1, *[1] * (y.ndim - 1)), jnp.zeros((), x.dtype), place)
        return field(t, whole).reshape(y.shape[0], -1)[:, 0]

    return jax.jacfwd(rate)(y.reshape(y.shape[0], -1)[:, 0])


def _inverses(mus: Array, jacobian: Array) -> Array:
    """(m, k, k) inverses of 1 - mu J, by Gauss-Jordan elimination with pivoting.

    Rows are not swapped but selected: that needs no scatter, which would prevent fusion of the
    stepping loop. A singular matrix gives NaN, and the step is rejected.
    """
    k = jacobian.shape[0]
    eye = jnp.eye(k, dtype=mus.dtype)
    x = jnp.concatenate(
        [
            eye[None] - mus[:, None, None] * jacobian.astype(mus.dtype)[None],
            jnp.broadcast_to(eye, (len(mus), k, k)),
        ],
        axis=2,
    )
    rows = jnp.arange(k)

    def eliminate(j, carry):
        x, order, free = carry
        column = jax.lax.dynamic_index_in_dim(x, j, axis=2, keepdims=False)
        sizes = jnp.where(free, jnp.abs(column), -1.0)
        chosen = rows[None] == jnp.argmax(sizes, axis=1)[:, None]
        row = jnp.sum(jnp.where(chosen[..., None], x, 0.0), axis=1)
        pivot = jnp.sum(jnp.where(chosen, column, 0.0), axis=1)
        row = row / pivot[:, None]
        x = x - jnp.where(chosen, column - 1.0, column)[..., None] * row[:, None, :]
        here = (rows[None, :, None] == j) & chosen[:, None, :]
        order = order + here.astype(order.dtype)
        return x, order, free & ~chosen

    start = (x, jnp.zeros((len(mus), k, k), x.dtype), jnp.ones((len(mus), k), bool))
    x, order, _ = jax.lax.fori_loop(0, k, eliminate, start)
    # Row i of the inverse is at the pivot row of column i.
    return jnp.sum(order[..., None] * x[:, None, :, k:], axis=2)


def _weighted_sum(parts: list[Array], row: np.ndarray) -> Array:
    return functools.reduce(jnp.add, [w * x for w, x in zip(row.tolist(), parts, strict=True)])


def _apply(matrix: Array, x: Array) -> Array:
    """A matrix (k, k) times x (k, ...), as a sum: a call would prevent fusion of the loop."""
    return jnp.sum(matrix.reshape(*matrix.shape, *[1] * (x.ndim - 1)) * x[None], axis=1)


def _radau(name: str, s: int) -> Radau:
    legendre = np.polynomial.legendre.Legendre
    nodes = (legendre.basis(s) - legendre.basis(s - 1)).roots()
    c = (np.sort(nodes.real) + 1) / 2
    c[-1] = 1.0
    return Radau(name, c, collocation(c))


#: Three stages, order 5: the second method for error estimates.
RADAU5 = _radau("Radau 5", 3)
#: Five stages, order 9, for stiff scenes.
RADAU9 = _radau("Radau 9", 5)
