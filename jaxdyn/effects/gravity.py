"""Gravity: uniform, and the mutual attraction of all points."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._floats import as_float
from jaxdyn._numerics import square_norm
from jaxdyn.effects.pairs import sum_over_bodies
from jaxdyn.scene import Effect, Points

# From about this many bodies on, `sum_over_bodies` beats a program with one scalar expression a
# pair, which is 3 to 4 times faster at n = 3 but grows as n^2.
_ROWS_FROM = 9


class UniformGravity(Effect):
    """The same acceleration g [m/s^2] for every mass, along the negative last axis."""

    g: Array = eqx.field(converter=as_float, default=9.81)
    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        del t
        return self.g * jnp.sum(m * r[:, -1])

    def force(self, t, r, v, m):
        del t, v
        up = np.eye(r.shape[1])[-1]
        return (-self.g * m)[:, None] * up[None, :]

    def acceleration(self, t, r, v, m):
        return self.force(t, r, v, jnp.ones_like(m))

    def check(self, points: Points) -> None:
        del points
        _checks.array("g", self.g, (), "In m/s^2, against the last axis.")


class PairGravity(Effect):
    """Newtonian attraction G m_i m_j / r_ij^2 between all points; G [m^3/(kg s^2)].

    A point of mass 0, a test particle, is attracted by the others and attracts nothing.
    """

    G: Array = eqx.field(converter=as_float, default=1.0)
    velocity_dependent: ClassVar[bool] = False
    singular: ClassVar[str] = (
        "Bodies that meet attract each other infinitely: regularised.simulate_regularised follows "
        "near collisions."
    )

    @property
    def without_units(self):
        return not _checks.is_traced(self.G) and bool(self.G == 1)

    def potential(self, t, r, m):
        del t
        if r.shape[0] < _ROWS_FROM:
            i, j = np.triu_indices(r.shape[0], 1)
            return -self.G * jnp.sum(m[i] * m[j] / jnp.sqrt(square_norm(r[j] - r[i])))

        def add(total, mass, d, r2):
            del d
            return total + mass / jnp.sqrt(r2)

        return -0.5 * self.G * jnp.sum(m * sum_over_bodies(add, r, m, jnp.zeros_like(m)))

    def force(self, t, r, v, m):
        return m[:, None] * self.acceleration(t, r, v, m)

    def acceleration(self, t, r, v, m):
        del t, v
        if r.shape[0] < _ROWS_FROM:
            return self._acceleration_by_pairs(r, m)

        def add(total, mass, d, r2):
            return total + (mass / (r2 * jnp.sqrt(r2)))[None] * jnp.stack(d)

        return self.G * sum_over_bodies(add, r, m, jnp.zeros_like(r.T)).T

    def _acceleration_by_pairs(self, r, m):
        n = r.shape[0]
        total = [jnp.zeros_like(r[0])] * n
        for i in range(n):
            for j in range(i + 1, n):
                d = r[j] - r[i]
                r2 = square_norm(d)
                d = (self.G / (r2 * jnp.sqrt(r2))) * d
                total[i], total[j] = total[i] + m[j] * d, total[j] - m[i] * d
        return jnp.stack(total)

    def check(self, points: Points) -> None:
        _checks.array("G", self.G, (), "One number for all pairs.")
        r = np.asarray(points.r)
        order = np.lexsort(r.T)  # equal places become neighbours
        same = np.flatnonzero((np.diff(r[order], axis=0) == 0).all(axis=1))
        if same.size:
            i, j = sorted(order[same[0] : same[0] + 2].tolist())
            raise _checks.fail(
                "y0",
                "bodies at different points",
                f"bodies {i + 1} and {j + 1} both at {r[i].tolist()}",
                "Their attraction is infinite there; move one.",
            )
