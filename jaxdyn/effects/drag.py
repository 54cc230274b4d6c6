"""Resistance to motion: drag proportional to speed or its square, and dry friction."""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._checks import as_float
from jaxdyn._numerics import safe_norm, safe_sqrt, square_norm
from jaxdyn.effects._parts import at_least_zero, vector_or_zero
from jaxdyn.scene import Effect, Points


class _Drag(Effect):
    """A force that depends on the velocity relative to the air, v - wind."""

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
    """Drag -c (v - wind) on each point; c [kg/s], wind (d,) [m/s] or 0."""

    def force(self, t, r, v, m):
        del t, r, m
        return -self.c * self.through(v)


class QuadraticDrag(_Drag):
    """Drag -c |v - wind| (v - wind) on each point; c [kg/m], wind (d,) [m/s] or 0."""

    def force(self, t, r, v, m):
        del t, r, m
        u = self.through(v)
        return -self.c * safe_norm(u)[:, None] * u


class DryFriction(Effect):
    """Coulomb friction -mu N u / sqrt(|u|^2 + creep^2) on points that slide.

    mu [1]; normal force N [N], () or (n,), one for each point; u = v - belt is the velocity
    over the surface, belt (d,) [m/s] or 0.

    Limits: with creep = 0, the default, this is the law of sliding: mu N against the motion,
    and zero at rest, where the true force is the one that keeps the point at rest. The
    acceleration then jumps where u passes 0: end a motion there by an event and continue with a
    phase of rest. A creep [m/s] > 0 regularises the law: it is smooth, accurate to
    (creep / u)^2 / 2 for speeds well above it, and viscous below it, so that nothing sticks.
    """

    mu: Array = eqx.field(converter=as_float)
    normal: Array = eqx.field(converter=as_float)
    belt: Array = eqx.field(converter=as_float, default=0.0)
    creep: Array = eqx.field(converter=as_float, default=0.0)
    singular: ClassVar[str] = (
        "Dry friction has no direction where the sliding stops: end the motion by an event at a "
        "small speed, and continue from rest where other forces exceed mu N; or give it a creep."
    )

    def force(self, t, r, v, m):
        del t, r
        u = v - jnp.broadcast_to(self.belt, v.shape)
        speed = safe_sqrt(square_norm(u) + self.creep * self.creep)
        friction = self.mu * jnp.broadcast_to(self.normal, m.shape)
        return -(friction / jnp.where(speed == 0, 1.0, speed))[:, None] * u

    def check(self, points: Points) -> None:
        for name in ("mu", "creep"):
            at_least_zero(name, getattr(self, name), "The surface only pushes.")
        at_least_zero("normal", self.normal, "The surface only pushes.", len(points.m))
        vector_or_zero("belt", self.belt, points.r.shape[1])
