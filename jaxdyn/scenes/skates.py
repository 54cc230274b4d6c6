"""A body on skates, sliding freely on a plane: course problem 39.

Each skate allows its point of the body to move along its blade but not across: one rolling
condition, and one force across the blade. Two routes to the same motion: `Constrained` (the DAE of
Newton-Euler) and `by_lagrange` (Lagrange's equations with the conditions derived by hand).

The result has a simple reason (39 d). The blades are fixed in the body, so the velocities that two
skates allow, in body axes, are the multiples of one twist, whose size the energy determines. A body
with a constant twist turns about the point where the two normals meet, or moves in a straight line
if they are parallel: `elementary_motion`.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._floats import floats
from jaxdyn._numerics import solve_spd
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.formulations.mechanism import Mechanism, MechanismSystem, planar_body
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import ready_made
from jaxdyn.sketch import Shape, frame, line, rectangle, traces

#: Beyond this the skates count as having a common normal: a repeated condition [condition number].
_WORST_CONDITION = 1e6
#: Relative speed below which a skate counts as at rest beside the other [1].
_MIN_SPEED = 1e-12


class Skated(Mechanism):
    """A planar body on skates.

    Attributes:
      m: () mass [kg].
      inertia: () about the centre of mass [kg m^2].
      at: (s, 2) positions of the skates from the centre of mass, in body axes [m].
      headings: (s,) directions of their blades in body axes [rad].
      wheels: (2,) positions of a car's front and rear axle along its x axis [m], for drawings
        only; None for blades.
    """

    m: Array
    inertia: Array
    at: Array
    headings: Array
    wheels: Array | None = None

    def coordinates(self):
        return (("x", "m"), ("y", "m"), ("theta", "rad"))

    def masses(self):
        return jnp.stack([self.m, self.m]) / 2

    def positions(self, t, q):
        del t
        return planar_body(q[:2], q[2], jnp.sqrt(self.inertia / self.m))

    def rolling(self, t, q):
        del t
        angle = q[2] + self.headings
        return jnp.stack([-jnp.sin(angle), jnp.cos(angle), self._arms()], axis=-1)

    def sketch(self, t, q):
        place, turn = q[:2], frame(jnp.stack([jnp.cos(q[2]), jnp.sin(q[2])]))
        if self.wheels is not None:
            return tuple(shape.placed(place, turn) for shape in _car(self.wheels))
        size = jnp.sqrt(self.inertia / self.m)
        # The centre of mass; a circle would look like the mark of an end.
        shapes = [rectangle("area", (0.25 * size, 0.25 * size))]
        for at, heading in zip(self.at, self.headings, strict=True):
            blade = rectangle("solid", (0.6 * size, 0.08 * size))
            way = frame(jnp.stack([jnp.cos(heading), jnp.sin(heading)]))
            shapes += [line(jnp.zeros(2), at), blade.placed(at, way)]
        shapes += traces(self.at, [f"skate {i + 1}" for i in range(len(self.at))])
        return tuple(shape.placed(place, turn) for shape in shapes)

    def twists(self) -> Array:
        """(s, 3) the conditions in body axes: rows whose product with (vx, vy, omega) is zero."""
        return self.rolling(jnp.zeros(()), jnp.zeros(3))

    def check(self):
        _checks.positive("mass", self.m, "Masses are in kg.")
        _checks.positive("inertia", self.inertia, "Inertias are in kg m^2.")
        scale = np.array([1.0, 1.0, np.sqrt(self.m / self.inertia)])
        condition = np.linalg.cond(np.asarray(self.twists()) * scale)
        if not condition < _WORST_CONDITION:
            raise _checks.fail(
                "skates",
                "conditions that differ",
                f"skates on a common normal line (condition number {condition:.3g})",
                "They ask for the same twice, and their two forces cannot be told apart: "
                "move or turn one, or leave it out.",
            )

    def _arms(self) -> Array:
        x, y = self.at[:, 0], self.at[:, 1]
        return x * jnp.cos(self.headings) + y * jnp.sin(self.headings)


def _car(axles: Array) -> tuple[Shape, ...]:
    """A car seen from above, in its own axes, with its axles at two positions (2,) along x."""
    base = axles[0] - axles[1]
    track, across = 0.55 * base, jnp.zeros(())
    middles = jnp.stack([axles, jnp.stack([across, across])], axis=1)
    body = rectangle("area", (1.5 * base, 0.65 * base), jnp.mean(middles, axis=0))
    wheels = [
        rectangle(
            "solid", (0.25 * base, 0.08 * base), middle + jnp.stack([across, side * track / 2])
        )
        for middle in middles
        for side in (1.0, -1.0)
    ]
    return body, *wheels, *traces(middles, ["front axle", "rear axle"])


class LagrangeSkates(MechanismSystem):
    """Lagrange's equations of a body on skates, with multipliers, by hand: state [q, v].

    L = m (x'^2 + y'^2) / 2 + I theta'^2 / 2 has no slope in q, so m x'' = Q_x, m y'' = Q_y,
    I theta'' = Q_theta. A skate's force lambda across its blade does the virtual work
    lambda (-sin a dx + cos a dy + arm dtheta), a = theta + heading, which gives the Q. Its
    condition -sin a x' + cos a y' + arm theta' = 0, differentiated once, closes the system:

        -sin a x'' + cos a y'' + arm theta'' = theta' (cos a x' + sin a y').
    """

    mechanism: Skated

    @property
    def accepts(self):
        return frozenset()  # the equations of problem 39 have no other forces in them

    def rate(self, t, y, effects):
        del effects
        body = self.mechanism
        _, v = jnp.split(y, 2)
        b = body.rolling(t, y[:3])
        # cos a = b[:, 1] and sin a = -b[:, 0].
        needed = v[2] * (b[:, 1] * v[0] - b[:, 0] * v[1])
        reach = b / jnp.stack([body.m, body.m, body.inertia])[None, :]
        multipliers = solve_spd(jnp.sum(b[:, None, :] * reach[None, :, :], axis=-1), needed)
        return jnp.concatenate([v, jnp.sum(multipliers[:, None] * reach, axis=0)])


@ready_made()
def one_skate(
    *, m=1.0, inertia=0.5, at=(0.0, 0.0), heading=0.0, speed=1.0, spin=1.0, t1=10.0
) -> Scene:
    """A body on one skate, gliding and spinning (problem 39 a).

    With the skate at the centre of mass it moves on a circle of radius speed / spin. Otherwise it
    turns until it glides in a straight line, with the centre of mass ahead.

    Args:
      m: mass [kg].
      inertia: about the centre of mass [kg m^2].
      at: (2,) position of the skate from the centre of mass, which is at the origin [m].
      heading: direction of the blade [rad].
      speed: of the skate along its blade [m/s].
      spin: angular velocity [rad/s].
      t1: span [s].
    """
    at, heading = floats(at, heading)
    (x, y), c, s = at, jnp.cos(heading), jnp.sin(heading)
    v = jnp.stack([speed * c + spin * y, speed * s - spin * x, jnp.asarray(spin)])
    return _on_skates(m, inertia, at[None], heading[None], v, t1)


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
      inertia: about the centre of mass [kg m^2].
      at: (2, 2) positions of the skates from the centre of mass, which is at the origin [m].
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


def allowed_twist(body: Skated) -> Array:
    """(3,) the twist (vx, vy, omega) in body axes that two skates allow, of mean square speed 1.

    The first skate moves forwards or, if it is at rest, the second.
    """
    first, second = body.twists()
    twist = jnp.cross(first, second)
    size = jnp.sum(twist * twist * jnp.stack([1.0 + 0 * body.m, 1.0, body.inertia / body.m]))
    # Skates on a common normal have no such twist; `check` reports them, not a NaN.
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
    """The same body and start by Lagrange's equations with multipliers (problem 39 c)."""
    return dataclasses.replace(scene, system=LagrangeSkates(scene.system.mechanism))


def meeting_point(scene: Scene) -> Array:
    """(2,) the point where the normals of two skates meet, at the start.

    Limits: for parallel normals not finite, or as far away as rounding puts it.
    """
    x, y, theta, vx, vy, omega = scene.y0
    del theta
    return jnp.stack([x - vy / omega, y + vx / omega])


def elementary_motion(scene: Scene, ts: Array) -> Array:
    """(s, 6) states of a body on two skates without solving any equation (problem 39 d).

    Its twist is constant: with c = (1 - cos omega t) / omega and s = sin(omega t) / omega the
    centre moves by (s vx - c vy, c vx + s vy). Both ratios have limits at omega = 0, so a
    straight line needs no special treatment.
    """
    x, y, theta, vx, vy, omega = scene.y0
    ts = jnp.asarray(ts)
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
