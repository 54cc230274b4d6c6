"""Gauss-Legendre collocation: symplectic even for velocity-dependent forces.

s stages at the Gauss nodes give order 2 s. The step is implicit; with L_i = h b_i f(Y_i),

    Y_i = y + sum_j mu_ij L_j,    y1 = y + sum_j L_j,    mu_ij + mu_ji = 1,

and the last property, which makes the method symplectic and conserves every quadratic invariant,
holds exactly for the rounded mu_ij here (Antonana, Makazaga, Murua 2017, Numer. Algorithms 76,
861). The equations are solved by fixed-point iteration until rounding stops it, so that the
remaining error is rounding and not a bias (Hairer, McLachlan, Razakarivony 2008, BIT 48, 231).

The map is symplectic in coordinates that are canonical, or canonical after a linear map: q and v of
free points with magnetic or gyroscopic forces. Where the mass matrix depends on q, and for
projected constraints, the map is still symmetric: energies of reversible motions do not drift.
"""

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.solvers.method import Advance, Method, Rate

_MAX_ITERATIONS = 100  # a step that needs more is too long
#: Iterations end at changes below rounding; if the last change is as large as this, they did not
#: converge.
_MAX_LAST_CHANGE = 1e-10


def collocation(c: np.ndarray) -> np.ndarray:
    """(s, s) integrals of the Lagrange polynomials of the nodes c (s,) from 0 to each node."""
    s = len(c)
    x, w = np.polynomial.legendre.leggauss(s)
    at = c[:, None] * (x + 1) / 2  # (s, s): a Gauss rule on [0, c_i] is exact
    a = np.empty((s, s))
    for j in range(s):
        others = np.delete(c, j)
        lagrange = np.prod((at[..., None] - others) / (c[j] - others), axis=-1)
        a[:, j] = c * (lagrange @ w) / 2
    return a


def mix(matrix: np.ndarray, x: Array) -> Array:
    """(..., r) a matrix (r, s) applied to the last axis of x (..., s).

    It is an unrolled sum: a product of matrices would prevent fusion of the stepping loop.
    """
    return jnp.sum(x[..., None, :] * matrix.reshape(*[1] * (x.ndim - 1), *matrix.shape), axis=-1)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Gauss(Method):
    """Gauss-Legendre collocation with fixed steps.

    Attributes:
      name: its name in reports.
      c: (s,) nodes.
      b: (s,) weights.
      mu: (s, s) stage weights a_ij / b_j.
    """

    name: str
    c: np.ndarray
    b: np.ndarray
    mu: np.ndarray
    adaptive: ClassVar[bool] = False
    position_only: ClassVar[bool] = False
    stable: ClassVar[float] = np.inf
    several: ClassVar[bool] = False

    @property
    def order(self) -> int:
        """Twice the number of stages."""
        return 2 * self.stages

    @property
    def error_order(self) -> int:
        """No error is estimated; required by diffrax."""
        return self.order

    @property
    def stages(self) -> int:
        """Right-hand sides per iteration."""
        return len(self.c)

    def advance(self, field: Rate, t: Array, h: Array, y: Array) -> Advance:
        fields = jax.vmap(field, in_axes=(0, -1), out_axes=-1)  # stages last
        times, parts = t + h * self.c, (h * self.b).reshape(*[1] * y.ndim, self.stages)
        small = _MAX_LAST_CHANGE * jnp.max(jnp.abs(y))

        def slopes(shift):
            return parts * fields(times, y[..., None] + shift)

        def go_on(carry):
            n, _, change, before = carry
            return (
                (n < _MAX_ITERATIONS)
                & (change > 0)
                & ((n < 3) | (change < before) | ~(change <= small))
            )

        def again(carry):
            n, shift, change, _ = carry
            new = mix(self.mu, slopes(shift))
            return n + 1, new, jnp.max(jnp.abs(new - shift)), change

        first = mix(self.mu, parts * field(t, y)[..., None])
        far = jnp.full((), jnp.inf, y.dtype)
        _, shift, change, _ = jax.lax.while_loop(go_on, again, (0, first, far, far))
        increment = jnp.sum(slopes(shift), axis=-1)
        return Advance(increment, jnp.zeros_like(y), converged=change <= small)


def _gauss(name: str, s: int) -> Gauss:
    x, w = np.polynomial.legendre.leggauss(s)
    c, b = (x + 1) / 2, w / 2
    mu = collocation(c) / b
    # The larger of each pair: one minus it is exact.
    mu = np.where(mu >= mu.T, mu, 1.0 - mu.T)
    np.fill_diagonal(mu, 0.5)
    return Gauss(name=name, c=c, b=b, mu=mu)


#: Four stages, order 8.
GAUSS8 = _gauss("Gauss 8", 4)
#: Six stages, order 12: for steps of a twentieth of a period and errors near rounding.
GAUSS12 = _gauss("Gauss 12", 6)
