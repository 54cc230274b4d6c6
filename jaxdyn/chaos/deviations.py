"""Systems that carry unit tangents with their motion, for ensembles.

A unit tangent u of a motion obeys u' = J u - (u . J u) u, with J the Jacobian of the rate: its
length stays 1, so that it neither overflows nor underflows however long the motion is. Lengths are
those in the sizes of the entries, which do not depend on units. Rounding and the errors of steps
are removed after each step (`System.project`). What is to be averaged along the
motion is integrated as further entries of the state.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.field import Field
from jaxdyn.integrate.variational import Variational
from jaxdyn.system import System


class Deviations(System):
    """A motion with unit tangents: the state is [y, u_1, ..., u_m, averages].

    Attributes:
      field: that of the motion.
      sizes: (k,) of the entries of its state.
      count: m, the number of tangents.
      averaged: whether the four entries of `Averages` follow, for the first tangent.
    """

    field: Field
    sizes: Array
    count: int = eqx.field(static=True)
    averaged: bool = eqx.field(static=True, default=False)

    def labels(self):
        names = self.field.system.labels()
        tangents = [(f"{name}'{i}", "1") for i in range(self.count) for name, _ in names]
        averages = [(name, "1") for name in ("growth", "weighted", "mean", "time")]
        return (*names, *tangents, *(averages if self.averaged else ()))

    def rate(self, t, y, effects):
        del effects
        columns, averages = self.split(y)
        rates = _variational(self.field).rate(t, columns)
        u, growing = columns[:, 1:], rates[:, 1:]
        growth = jnp.sum(u * growing / self.sizes[:, None] ** 2, axis=0)
        turning = growing - u * growth[None, :]
        parts = [rates[:, 0], turning.T.ravel()]
        return jnp.concatenate([*parts, *self._averages(growth, averages)])

    def _averages(self, growth: Array, averages: Array) -> tuple[Array, ...]:
        """The rates of the averages: G' = g, P' = 2 s g, M' = P / s, s' = 1."""
        if not self.averaged:
            return ()
        _, weighted, _, s = averages
        start = s == 0
        mean = jnp.where(start, 0.0, weighted / jnp.where(start, 1.0, s))
        return (jnp.stack([growth[0], 2.0 * s * growth[0], mean, jnp.ones_like(s)]),)

    def project(self, t, y):
        columns, averages = self.split(y)
        columns = _variational(self.field).project(t, columns)
        u = columns[:, 1:]
        u = u / jnp.sqrt(jnp.sum((u / self.sizes[:, None]) ** 2, axis=0))[None, :]
        return jnp.concatenate([columns[:, 0], u.T.ravel(), averages])

    def undetermined(self, t, y):
        return self.field.undetermined(t, self.split(y)[0][:, 0])

    def loses(self, t0, y0, t1, y1):
        return self.field.loses(t0, self.split(y0)[0][:, 0], t1, self.split(y1)[0][:, 0])

    def split(self, y: Array) -> tuple[Array, Array]:
        """(k, 1 + m) the motion and its tangents as columns, and the averages."""
        columns = y[: len(y) - (4 if self.averaged else 0)]
        return columns.reshape(1 + self.count, -1).T, y[len(columns) :]


def _variational(field: Field) -> Variational:
    return Variational(field, jax.tree.map(lambda _: None, field))
