"""External forces as given functions of time: constant, a step, a sine.

They act equally on the chosen points. A step of the integrator ends where a force jumps, so that no
step is rejected there.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn.effects._parts import point_number
from jaxdyn.scene import Effect, Points

_EACH_AXIS = "One component for each axis."


class ConstantForce(Effect):
    """The same force F on each of the chosen points, all of them if None.

    Attributes:
      F: (d,) force [N].
    """

    F: Array = eqx.field(converter=as_float)
    on: tuple[int, ...] | None = eqx.field(static=True, default=None)
    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        del t, m
        return -jnp.sum(_at_points(self.F, self.on, r) * r)

    def force(self, t, r, v, m):
        del t, v, m
        return _at_points(self.F, self.on, r)

    def check(self, points: Points) -> None:
        _check(self.F, self.on, points)


class StepForce(Effect):
    """Zero before time t_on, the force F on the chosen points from then on.

    Attributes:
      F: (d,) force [N].
      t_on: () time at which it begins [s].
    """

    F: Array = eqx.field(converter=as_float)
    t_on: Array = eqx.field(converter=as_float, default=0.0)
    on: tuple[int, ...] | None = eqx.field(static=True, default=None)
    velocity_dependent: ClassVar[bool] = False

    def force(self, t, r, v, m):
        del v, m
        return jnp.where(t >= self.t_on, 1.0, 0.0) * _at_points(self.F, self.on, r)

    def check(self, points: Points) -> None:
        _check(self.F, self.on, points)


class SinusoidalForce(Effect):
    """F sin(omega t + phase) on the chosen points.

    Attributes:
      F: (d,) amplitude of the force [N].
      omega: () angular frequency [rad/s].
      phase: () phase at t = 0 [rad].
    """

    F: Array = eqx.field(converter=as_float)
    omega: Array = eqx.field(converter=as_float)
    phase: Array = eqx.field(converter=as_float, default=0.0)
    on: tuple[int, ...] | None = eqx.field(static=True, default=None)
    velocity_dependent: ClassVar[bool] = False

    def force(self, t, r, v, m):
        del v, m
        return jnp.sin(self.omega * t + self.phase) * _at_points(self.F, self.on, r)

    def check(self, points: Points) -> None:
        _check(self.F, self.on, points)


def _at_points(force: Array, on: tuple[int, ...] | None, r: Array) -> Array:
    """(n, d) the force (d,) at the chosen points, zero elsewhere."""
    n, d = r.shape
    # The shape is checked before the force is broadcast, in every trace.
    _checks.check_shape("F", force.shape, (d,), _EACH_AXIS)
    _check_points(on, n)
    chosen = jnp.ones(n) if on is None else jnp.asarray(np.eye(n)[list(on)].sum(axis=0))
    return chosen[:, None] * force[None, :]


def _check(force: Array, on: tuple[int, ...] | None, points: Points) -> None:
    _checks.array("F", force, (points.r.shape[1],), _EACH_AXIS)
    _check_points(on, len(points.m))


def _check_points(on: tuple[int, ...] | None, n: int) -> None:
    if not isinstance(on, tuple | None):
        remedy = "Their numbers, such as (0, 2)."
        raise _checks.fail("on", "None for all points, or a tuple", repr(on), remedy)
    for i in on or ():
        point_number("on", i, n)
