"""A body on skates, sliding freely on a plane: course problem 39.

Each skate allows its point of the body to move along its blade but not across it: one rolling
condition, and one force across the blade. There are two routes to the same motion: `Constrained`
(the DAE of Newton-Euler) and `by_lagrange` (Lagrange's equations, derived by hand, with the
conditions), both for the mechanisms of `mechanisms.skates`.

The result has a simple reason (39 d). The blades are fixed in the body, so the velocities that two
skates allow, in body axes, are the multiples of one twist, whose size the energy determines. A body
with a constant twist turns about the point where the two normals meet, or moves in a straight line
if they are parallel: `elementary_motion`.
"""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._checks import floats
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.mechanisms.skates import LagrangeSkates, Skated
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import ready_made

#: Ratio of the speeds of two skates along their blades below which the slower counts as at rest.
_MIN_SPEED = 1e-12


@ready_made()
def one_skate(
    *, m=1.0, inertia=0.5, at=(0.0, 0.0), heading=0.0, speed=1.0, spin=1.0, t1=10.0
) -> Scene:
    """A body on one skate, gliding and spinning (problem 39 a).

    With the skate at the centre of mass it moves on a circle of radius speed / spin. Otherwise it
    turns until it glides in a straight line, with the centre of mass ahead.

    Args:
      m: mass [kg].
      inertia: moment of inertia about the centre of mass [kg m^2].
      at: (2,) position of the skate from the centre of mass, which starts at the origin [m].
      heading: direction of the blade [rad].
      speed: speed of the skate along its blade [m/s].
      spin: angular velocity [rad/s].
      t1: span [s].
    """
    at, heading, speed, spin = floats(at, heading, speed, spin)
    v = _gliding(at, heading, speed, spin)
    return _on_skates(m, inertia, at[None], heading[None], v, t1)


@jax.jit  # one program, not one for each operation
def _gliding(at: Array, heading: Array, speed: Array, spin: Array) -> Array:
    """(3,) the velocities of `one_skate`."""
    x, y = at
    return jnp.stack(
        [speed * jnp.cos(heading) + spin * y, speed * jnp.sin(heading) - spin * x, spin]
    )


@ready_made()
def two_skates(
    *,
    m=1.0,
    inertia=0.5,
    at=((1.0, 0.0), (-0.5, 0.3)),
    headings=(0.4, -0.2),
    speed=1.0,
    t1=10.0,
) -> Scene:
    """A body on two skates, with the motion that they allow (problem 39).

    Args:
      m: mass [kg].
      inertia: moment of inertia about the centre of mass [kg m^2].
      at: (2, 2) positions of the skates from the centre of mass, which starts at the origin [m].
      headings: (2,) directions of their blades [rad].
      speed: root mean square speed of the body's mass [m/s]; for a positive one the first skate
        moves forwards along its blade (the second, if the body turns about the first).
      t1: span [s].
    Raises:
      ValueError: the skates have a common normal line; raised when the scene is run.
    """
    at, headings = floats(at, headings)
    scene = _on_skates(m, inertia, at, headings, jnp.zeros(3), t1)
    twist = allowed_twist(scene.system.mechanism)
    return scene.starting(jnp.concatenate([jnp.zeros(3), speed * twist]))


@jax.jit
def allowed_twist(body: Skated) -> Array:
    """(3,) the twist (vx, vy, omega) in body axes that two skates allow, of mean square speed 1.

    The first skate moves forwards or, if it is at rest, the second one does.
    """
    first, second = body.twists()
    twist = jnp.cross(first, second)
    size = jnp.sum(twist * twist * jnp.stack([1.0 + 0 * body.m, 1.0, body.inertia / body.m]))
    # Skates on a common normal have no such twist; `check` reports them, so no NaN is needed.
    twist = twist / jnp.sqrt(jnp.where(size == 0, 1.0, size))
    ahead = _blade_speeds(body, twist)
    still = jnp.abs(ahead[0]) <= _MIN_SPEED * jnp.abs(ahead[1])
    return jnp.where(jnp.where(still, ahead[1], ahead[0]) < 0, -twist, twist)


def _blade_speeds(body: Skated, twist: Array) -> Array:
    """(s,) velocity of each skate along its blade [m/s]."""
    vx, vy, omega = twist
    x, y = body.at[:, 0], body.at[:, 1]
    return (vx - omega * y) * jnp.cos(body.headings) + (vy + omega * x) * jnp.sin(body.headings)


def by_lagrange(scene: Scene) -> Scene:
    """The same body and start with Lagrange's equations and multipliers (problem 39 c)."""
    return dataclasses.replace(scene, system=LagrangeSkates(scene.system.mechanism))


def meeting_point(scene: Scene) -> Array:
    """(2,) the point where the normals of two skates meet at the start.

    Limits: for parallel normals it is not finite, or as far away as rounding puts it.
    """
    x, y, theta, vx, vy, omega = scene.y0
    del theta
    return jnp.stack([x - vy / omega, y + vx / omega])


def elementary_motion(scene: Scene, ts: Array) -> Array:
    """(s, 6) states of a body on two skates, found without solving an equation (problem 39 d).

    The twist of the body is constant: with c = (1 - cos omega t) / omega and s = sin(omega t) /
    omega, the centre moves by (s vx - c vy, c vx + s vy). Both ratios have limits at omega = 0, so
    a straight line needs no special treatment.
    """
    return _turning(scene.y0, jnp.asarray(ts))


@jax.jit
def _turning(y0: Array, ts: Array) -> Array:
    x, y, theta, vx, vy, omega = y0
    turned = omega * ts
    s = ts * jnp.sinc(turned / jnp.pi)
    c = ts * jnp.sinc(turned / (2 * jnp.pi)) * jnp.sin(turned / 2)
    cos, sin = jnp.cos(turned), jnp.sin(turned)
    columns = (
        x + s * vx - c * vy,
        y + c * vx + s * vy,
        theta + turned,
        cos * vx - sin * vy,
        sin * vx + cos * vy,
        jnp.full_like(ts, omega),
    )
    return jnp.stack(columns, axis=-1)


def _on_skates(m, inertia, at, headings, v: Array, t1) -> Scene:
    m, inertia, at, headings = floats(m, inertia, at, headings)
    system = Constrained(Skated(m=m, inertia=inertia, at=at, headings=headings))
    return Scene(system, y0=jnp.concatenate([jnp.zeros(3), v]), t1=t1)
