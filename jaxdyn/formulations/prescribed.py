"""Prescribed motions: coordinates given as functions of time, independent of forces.

They are for drawings that move without dynamics (course problems 7, 47 and 49). The state is [q, v]
as for any mechanism, with dv/dt the second derivative of the path, so the same integrators, samples
and pictures apply; the deviation from the path checks the integrator.
"""

import abc

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.formulations.mechanism import Mechanism, MechanismSystem


class Path(Mechanism):
    """A mechanism whose coordinates are functions of time."""

    @abc.abstractmethod
    def path(self, t: Array) -> Array:
        """(n,) coordinates at time t ()."""

    def speed(self, t: Array) -> Array:
        """(n,) rates of the coordinates."""
        return jax.jvp(self.path, (t,), (jnp.ones_like(t),))[1]


class Prescribed(MechanismSystem):
    """A mechanism that follows its path: state [q, v]. Effects have no influence.

    A start off the path, or with another velocity, keeps that difference.
    """

    mechanism: Path

    @property
    def accepts(self):
        return frozenset()

    @property
    def second_order(self):
        return True

    def rate(self, t, y, effects):
        del effects
        t = jnp.asarray(t, y.dtype)
        _, v = jnp.split(y, 2)
        return jnp.concatenate([v, jax.jvp(self.mechanism.speed, (t,), (jnp.ones_like(t),))[1]])

    def state(self, t: Array) -> Array:
        """(2 n,) the state on the path at time t ()."""
        t = jnp.asarray(t, dtype=float)
        return jnp.concatenate([self.mechanism.path(t), self.mechanism.speed(t)])
