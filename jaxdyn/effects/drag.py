"""Resistance to motion: drag proportional to speed or its square, and dry friction."""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import as_float, is_traced
from jaxdyn._numerics import safe_norm, safe_sqrt, square_norm
from jaxdyn.effects._parts import at_least_zero, vector_or_zero
from jaxdyn.scene import Effect, Points


class _Drag(Effect):
    """A force that depends on the velocity relative to the air, v - wind.

    Attributes:
      wind: (d,) velocity of the air, or 0 [m/s].
    """

    c: Array = eqx.field(converter=as_float)
    wind: Array = eqx.field(converter=as_float, default=0.0)

    def through(self, v: Array) -> Array:
        """(n, d) velocities relative to the air [m/s]."""
        return v - jnp.broadcast_to(self.wind, v.shape)

    @abc.abstractmethod
    def force(self, t, r, v, m): ...

    def check(self, points):
        at_least_zero("c", self.c, "A negative drag drives the motion.")
        vector_or_zero("wind", self.wind, points.r.shape[1])


class LinearDrag(_Drag):
    """Drag -c (v - wind) on each point.

    Attributes:
      c: () drag coefficient [kg/s].
      wind: (d,) velocity of the air, or 0 [m/s].
    """

    def force(self, t, r, v, m):
        del t, r, m
        return -self.c * self.through(v)


class QuadraticDrag(_Drag):
    """Drag -c |v - wind| (v - wind) on each point.

    Attributes:
      c: () drag coefficient [kg/m].
      wind: (d,) velocity of the air, or 0 [m/s].
    """

    def force(self, t, r, v, m):
        del t, r, m
        u = self.through(v)
        return -self.c * safe_norm(u)[:, None] * u


def _unless_zero(creep: Any) -> Array | None:
    """A creep as a float array, or None if it is exactly 0: that law is another program."""
    absent = creep is None or (not is_traced(creep) and np.ndim(creep) == 0 and creep == 0)
    return None if absent else as_float(creep)


class DryFriction(Effect):
    """Coulomb friction -mu N u / sqrt(|u|^2 + creep^2) on points that slide.

    u = v - belt is the velocity over the surface.

    With creep = 0, the default, this is Coulomb's law: mu N against the motion, -mu N sign(u) on a
    line. There a point sticks as long as the other forces do not exceed mu N, and slides again when
    they do; several points may stick at the same time.

    Limits: friction at rest is no larger than in motion; for a larger one, write sticking and
    sliding as phases (`jaxdyn.integrate.phases.simulate_phases`). In the plane and in space,
    the force has no direction where u is 0, and is zero there: end the motion by an event at a
    small speed and continue with a phase of rest. A creep [m/s] > 0 regularises the law: it is
    smooth, accurate to (creep / u)^2 / 2 for speeds well above it, and viscous below it, so
    that nothing sticks. A creep that is traced and 0 does not stick either.

    Attributes:
      mu: () coefficient of friction [1].
      normal: () or (n,) normal force N on each point [N].
      belt: (d,) velocity of the surface, or 0 [m/s].
      creep: () speed below which the law is viscous, or 0 [m/s].
    """

    mu: Array = eqx.field(converter=as_float)
    normal: Array = eqx.field(converter=as_float)
    belt: Array = eqx.field(converter=as_float, default=0.0)
    creep: Array | None = eqx.field(converter=_unless_zero, default=None)
    singular: ClassVar[str] = (
        "Off a line, dry friction has no direction where the sliding stops: end the motion by an "
        "event at a small speed, and continue from rest where other forces exceed mu N; or give it "
        "a creep."
    )

    def force(self, t, r, v, m):
        del t, r
        u = v - jnp.broadcast_to(self.belt, v.shape)
        friction = (self.mu * jnp.broadcast_to(self.normal, m.shape))[:, None]
        if self.creep is None and v.shape[1] == 1:
            # Its jump is a condition of the rate, at which a motion stops or turns.
            return -friction * jnp.sign(u)
        square = square_norm(u)
        speed = safe_sqrt(square if self.creep is None else square + self.creep * self.creep)
        return -friction / jnp.where(speed == 0, 1.0, speed)[:, None] * u

    def check(self, points: Points) -> None:
        for name in ("mu", "creep"):
            if getattr(self, name) is not None:
                at_least_zero(name, getattr(self, name), "The surface only pushes.")
        at_least_zero("normal", self.normal, "The surface only pushes.", len(points.m))
        vector_or_zero("belt", self.belt, points.r.shape[1])
