"""Gravity: uniform, and the mutual attraction of all points."""

import itertools
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn._numerics import square_norm
from jaxdyn.effects._parts import on_ends
from jaxdyn.scene import Effect, Points

# ---- Sums over all pairs of bodies, a few bodies at a time against all
#
# Arrays of n x n pairs exceed the caches, and a last axis of 3 coordinates keeps XLA from using the
# vector units. Here each pass of a loop takes the pairs of four bodies with all others, with
# separate coordinates and bodies last: this takes 1.1 to 1.4 ns per ordered pair from 16 to 1024
# bodies, against 19 ns for arrays (n, n, 3), and no array is larger than n. [measured: a core with
# 512-bit vectors, gravity in space, in a compiled loop; one body per pass takes 1.3 to 2.4 ns,
# sixteen up to 8. To take each pair once would halve the square roots, but adds to entries one by
# one.]

_ROWS = 4  # bodies per pass


def sum_over_bodies(
    add: Callable[[Array, Array, list[Array], Array], Array], r: Array, m: Array, start: Array
) -> Array:
    """The totals of all n bodies, to which each of the n bodies adds.

    Args:
      add: (total, mass, d, r2) -> total, where a body of mass (n,) lies at displacements d, a
        list of (n,), and squared distances r2 (n,) from each of the bodies. From itself it lies
        at squared distance 1 with mass 0.
      r: (n, d) positions [m].
      m: (n,) masses [kg].
      start: (..., n) totals to begin with.
    Returns:
      (..., n) totals.
    Limits: derivatives in reverse mode compute each pass again instead of storing n x n arrays.
    """
    n, columns, numbers = len(m), list(r.T), jnp.arange(len(m))

    def one(total: Array, body: tuple[Array, Array, Array]) -> Array:
        number, place, mass = body
        d = [x - column for x, column in zip(place, columns, strict=True)]
        itself = numbers == number
        r2 = jnp.where(itself, 1.0, sum(x * x for x in d))
        return add(total, jnp.where(itself, 0.0, mass), d, r2)

    def several(total: Array, bodies: tuple[Array, Array, Array]) -> tuple[Array, None]:
        for i in range(len(bodies[0])):
            total = one(total, jax.tree.map(lambda x, i=i: x[i], bodies))
        return total, None

    bodies, whole = (numbers, r, m), n - n % _ROWS
    blocks = jax.tree.map(lambda x: x[:whole].reshape(-1, _ROWS, *x.shape[1:]), bodies)
    total, _ = jax.lax.scan(jax.checkpoint(several, prevent_cse=False), start, blocks)
    return several(total, jax.tree.map(lambda x: x[whole:], bodies))[0]


# ---- Gravity: uniform, and the mutual attraction of all points

# From about this many bodies on, `sum_over_bodies` beats a program with one scalar expression per
# pair, which is 3 to 4 times faster at n = 3 but grows as n^2.
_ROWS_FROM = 9


class UniformGravity(Effect):
    """The same acceleration g for every mass, along the negative last axis.

    Attributes:
      g: () acceleration of gravity [m/s^2].
    """

    g: Array = eqx.field(converter=as_float, default=9.81)
    velocity_dependent: ClassVar[bool] = False
    called: ClassVar[str] = "weight"

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
    """Newtonian attraction G m_i m_j / r_ij^2 between all points.

    A point of mass 0, a test particle, is attracted by the others and attracts nothing.

    Attributes:
      G: () gravitational constant [m^3/(kg s^2)].
    """

    G: Array = eqx.field(converter=as_float, default=1.0)
    velocity_dependent: ClassVar[bool] = False
    singular: ClassVar[str] = (
        "Bodies that meet attract each other infinitely: regularized.simulate_regularized follows "
        "near collisions."
    )

    def pieces(self, m):
        pairs = itertools.combinations(range(m.shape[0]), 2)
        return tuple(_Attraction(self.G, i, j) for i, j in pairs)

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


class _Attraction(Effect):
    """The attraction of two points alone."""

    G: Array
    i: int = eqx.field(static=True)
    j: int = eqx.field(static=True)
    called: ClassVar[str] = "attraction"

    def force(self, t, r, v, m):
        del t, v
        d = r[self.j] - r[self.i]
        r2 = square_norm(d)
        pull = self.G * m[self.i] * m[self.j] / (r2 * jnp.sqrt(r2)) * d
        return on_ends(pull, r.shape[0], self.i, self.j)
