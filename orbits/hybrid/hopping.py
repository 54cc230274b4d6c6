"""The eccentric cylinder that rolls, hops and lands without relative velocity: problem 38.

Such a motion loses no energy, so it continues for ever, on level ground: down a slope every hop
would gain energy. In the air the angular velocity w is constant, so the contact point lands with
zero velocity only if the flight is its own mirror image: from an angle -a of the centre of mass G
from the vertical to 2 pi n + a, n turns and a bit. Ballistics gives w^2 d sin a = g (pi n + a).

Under unilateral contact the flight starts where the contact force vanishes, and must not enter the
ground: both only if the cylinder's height h leaves with h'' = 0. So

    tan a = pi n + a,    w^2 = g / (d cos a),

the same for all masses, radii and inertias: the landing grazes, with only h''' nonzero.

Without friction that is a possible motion, and `hop` finds it. With friction there is none,
whatever its coefficient: rolling needs the force I alpha / (R + d cos a) at the corner, so contact
ends in slip, and slip costs energy; only at the top is alpha = 0, and there a flight enters the
ground. If friction is replaced by a constraint (``rolls=True``) the ground has to pull near the
corners: `pull` says how much. It is little if the inertia is far above m R^2.

Reference for motions without collisions: A. Chatterjee et al., International Journal of Robotics
Research 21 (2002) 621.
"""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail, whole
from jaxdyn._floats import as_float
from jaxdyn._records.kinds import check_first
from jaxdyn.integrate.events import Event, Reaches, until
from jaxdyn.mechanisms.cylinders import Cylinder
from jaxdyn.scenes.cylinders import Caught, NormalForce
from orbits.hybrid.legs import HybridOrbit, Leg
from orbits.hybrid.search import find_hybrid
from orbits.orbit import SearchError
from orbits.shooting.finding import GOAL, RTOL

_ROUNDS = 15  # of a fixed-point iteration
_ROUNDED = (
    "Rounding hides the hop: the inertia is below some 1e-8 of m d^2, or there are hundreds of "
    "turns in the air. Take a larger inertia, or fewer turns."
)


class Rises(Event):
    """A time derivative of the height of a flying cylinder.

    Attributes:
      flying: the cylinder in flight.
      order: 1 for the velocity, 2 for the acceleration; where that is positive a cylinder in
        unilateral contact would leave.
    """

    flying: Scene
    order: int = eqx.field(static=True)

    def value(self, t, y):
        def along(fn):
            return lambda y: jax.jvp(fn, (y,), (self.flying.rate(t, y),))[1]

        fn = self.flying.system.height
        for _ in range(self.order):
            fn = along(fn)
        return fn(y)


class Height(Event):
    """The distance of a cylinder from the surface."""

    cylinder: Cylinder

    def value(self, t, y):
        del t
        return self.cylinder.height(y)


class Mirrored(eqx.Module):
    """Residual of a motion's mirror symmetry: times about which it is time-reversible.

    One is in the middle of a flight, where it starts, one in the middle of a contact.

    Attributes:
      first: () turn at the start [rad].
      last: () turn at the end [rad].
    """

    first: Array = eqx.field(converter=as_float)
    last: Array = eqx.field(converter=as_float)

    def __call__(self, end: Array, start: Array) -> Array:
        """(3,) angle and vertical velocity at the start, angle at the end."""
        return jnp.stack([start[2] - self.first, start[4], end[2] - self.last])


class Advanced(eqx.Module):
    """Residual of closing up to the position on level ground and whole turns.

    Attributes:
      turn: () rotation in a period [rad].
    """

    turn: Array = eqx.field(converter=as_float)

    def __call__(self, end: Array, start: Array) -> Array:
        """(5,) height, turn and velocities."""
        return (end - start)[1:].at[1].add(-self.turn)


@check_first
def hop(scene: Scene, *, turns: int = 1, rolls: bool = False) -> HybridOrbit:
    """The lossless hopping motion of an eccentric cylinder: in contact, then in the air.

    Args:
      scene: ``scenes.cylinder_on_ramp(slope=0.0, ...)``; its start and friction are not used.
      turns: whole turns in the air, at least 1.
      rolls: a constraint without limits prevents slip, even where the ground has to pull; if
        False, there is no friction, and the cylinder slides between landings at which the contact
        point has zero velocity.
    Returns:
      The chain from the middle of a flight to the middle of the next: down, in contact, up. It
      advances by `advance` in a period, and rotates turns + 1 times.
    Raises:
      ValueError: `scene` is not an eccentric cylinder on level ground, or `turns` is less than 1.
      SearchError: rounding dominates, at an inertia far below m d^2 or after hundreds of turns.
    Example:
      >>> from jaxdyn import scenes
      >>> from orbits.hybrid import hopping
      >>> found = hopping.hop(scenes.cylinder_on_ramp(slope=0.0))
      >>> corner = float(found.legs[1].scene.y0[2]) - 2 * math.pi
      >>> abs(math.tan(corner) - (math.pi + corner)) < 1e-9
      True
    """
    g = _check_gravity(scene, turns)
    given = scene.system
    slides = eqx.tree_at(lambda system: system.mu, given, 0.0 * given.mu).touching("slip_on")
    contact, fly = (
        dataclasses.replace(scene, system=system)
        for system in (given.touching("roll") if rolls else slides, given.touching("fly"))
    )
    leaves = Rises(fly, 2)
    lands = (Height(given), Rises(fly, 1), leaves, Caught(given, 1))
    d, r, first = float(given.d), float(given.r), math.pi * turns
    a = _corner(turns)
    up = first + a
    spin = math.sqrt(g / (d * math.cos(a)))
    reach = r + d * math.cos(a)
    top = reach + g * (up / spin) ** 2 / 2  # of G, in the middle of the flight
    y0 = np.array([0.0, top, first, spin * reach, 0.0, spin])
    corner = np.array([y0[3] * up / spin, reach, first + up, y0[3], -g * up / spin, spin])
    # The contact lasts less than twice the time that it would take at the corner's spin.
    lowest = Reaches(2, 2 * first + math.pi, 1)
    stop = until(contact.starting(corner, 2 * (math.pi - a) / spin), lowest, rtol=RTOL)
    if not stop.happened:
        raise SearchError(_ROUNDED)
    spans = np.array([up / spin, float(stop.t)])
    # In the whole chain the motion is a double root: at h'' = 0 unequal corners close too.
    mirrors = Mirrored(first, 2 * first + math.pi)
    legs = (Leg(scene=fly, ends=lands), Leg(scene=contact, ends=()))
    half = _check(find_hybrid(legs, y0, spans, closes=mirrors, throw=False))
    down, rest = half.spans
    above = (Height(given),)
    presses = () if rolls else (NormalForce(contact),)
    chain = (
        Leg(scene=fly, ends=lands, bounds=above),
        Leg(scene=contact, ends=(leaves,), bounds=presses),
        Leg(scene=fly, ends=(), bounds=above),
    )
    spans = [down, 2 * rest, down]
    around = Advanced(2 * (first + math.pi))
    # Over the whole chain the residuals of the halves count several times.
    whole = 8 * GOAL
    return _check(
        find_hybrid(chain, half.y0, spans, closes=around, goal=whole, max_iterations=0, throw=False)
    )


def _check(found: HybridOrbit) -> HybridOrbit:
    """The motion found from an exact guess; raises if rounding prevented it."""
    if not found.ok:
        raise SearchError(_ROUNDED)
    return found


def _corner(turns: int) -> float:
    """a [rad] of tan a = pi n + a: each iteration reduces the error by a factor of 17 or more."""
    a = math.pi / 2
    for _ in range(_ROUNDS):
        a = math.atan(math.pi * turns + a)
    return a


@check_first
def advance(hop: HybridOrbit) -> float:
    """Advance of the cylinder along the ground in a period [m]."""
    return float(hop.trajectory(2).pieces[-1].ys[-1, 0] - hop.y0[0])


@check_first
def pull(hop: HybridOrbit) -> float:
    """Largest pull of the ground over the weight [1]; 0 if it only pushes."""
    scene = hop.legs[1].scene
    weight = float(scene.system.m) * _gravity(scene)
    return max(0.0, -hop.smallest(1, NormalForce(scene)) / weight)


def _gravity(scene: Scene) -> float:
    fly = scene.system.touching("fly")
    fall = fly.rate(jnp.zeros(()), scene.y0, scene.effects)
    return -float(fall[4])


def _check_gravity(scene: Scene, turns) -> float:
    """The acceleration of gravity [m/s^2], with the scene and the number of turns checked."""
    system = scene.system
    if not (isinstance(system, Cylinder) and system.flat):
        got = type(system).__name__
        raise fail("scene", "a cylinder on a ramp", got, "Use scenes.cylinder_on_ramp().")
    scene.check()
    if float(system.slope) != 0.0:
        remedy = "Each hop down a slope gains energy, and these landings lose none."
        raise fail("slope", "0, level ground", float(system.slope), remedy)
    if not float(system.d) > 0:
        raise fail("d", "> 0", float(system.d), "A balanced cylinder does not hop.")
    whole("turns", turns, remedy="With none the flight would enter the ground.")
    g = _gravity(scene)
    if not g > 0:
        raise fail("scene", "gravity downwards", f"g = {g:.6g}", "Add UniformGravity(9.81).")
    return g
