"""Coordinates with constant matrices: M q'' + K q = Q, state [q, v]."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn._numerics import solve_spd
from jaxdyn.formulations.mechanism import on_coordinates, with_rates
from jaxdyn.scene import System

#: Ratio of the smallest to the largest eigenvalue of M that may be only rounding.
_SINGULAR = 1e-13


class LinearSystem(System):
    """Coordinates with the kinetic energy v^T M v / 2 and the potential energy q^T K q / 2.

    Effects may act on the coordinates, such as `MatrixDamper`.

    Attributes:
      M: (n, n) mass matrix; symmetric, so that only its upper triangle is read.
      K: (n, n) stiffness matrix, likewise.
      names: (name, unit) of each of the n coordinates.
    """

    M: Array = eqx.field(converter=as_float)
    K: Array = eqx.field(converter=as_float)
    names: tuple[tuple[str, str], ...] = eqx.field(static=True)

    @property
    def accepts(self):
        return frozenset({"generalized"})

    @property
    def second_order(self):
        return True

    def labels(self):
        return with_rates(self.names)

    def rate(self, t, y, effects):
        q, v = jnp.split(y, 2)
        force = on_coordinates(jnp.asarray(t, y.dtype), q, v, effects)
        a = solve_spd(_symmetric(self.M), force - _symmetric(self.K) @ q)
        return jnp.concatenate([v, a])

    def kinetic(self, t, y):
        return self.energies(t, y, ())[0]

    def energies(self, t, y, effects):
        del t, effects
        q, v = jnp.split(y, 2)
        return 0.5 * v @ _symmetric(self.M) @ v, 0.5 * q @ _symmetric(self.K) @ q

    def canonical(self, t, y):
        del t
        q, v = jnp.split(y, 2)
        return jnp.concatenate([q, _symmetric(self.M) @ v])

    def check(self, t, y):
        del t
        for name in ("M", "K"):
            _checks.finite(name, getattr(self, name))
        if _checks.is_traced((self.M, y)):
            return
        values = np.linalg.eigvalsh(np.asarray(_symmetric(self.M)))
        if not values[0] > _SINGULAR * values[-1]:
            got = f"one with the eigenvalues {values.tolist()}"
            remedy = "Leave out coordinates without a mass: condense them statically."
            raise _checks.fail("M", "a positive definite matrix", got, remedy)


def _symmetric(x: Array) -> Array:
    """(n, n) the symmetric matrix that has the upper triangle of x (n, n)."""
    return jnp.triu(x) + jnp.triu(x, 1).T
