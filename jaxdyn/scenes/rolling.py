"""Cylinders rolling on a fixed cylinder and down a ramp, as far as they do: problems 37 and 38.

What the course asks, and what is wrong with it:

- 37 a: yes, the equation is that of an inverted pendulum of length R + r with g scaled by 2/3:
  (3/2)(R + r) theta'' = g sin theta. Energy and geometry leave theta alone, and rolling adds
  half of the mass to the inertia. 37 b: contact is lost at cos theta = 4/7 (from rest at the
  top). But the friction that rolling needs over the normal force is sin theta / (7 cos theta - 4):
  rolling to that very end needs unbounded friction. With any finite one the cylinder slips first.
- 38 c: where ideal rolling needs no normal force any more it still needs friction F, so taking
  the surface away changes the motion there: the cylinder would leave the ramp with the
  acceleration d sin(psi) (r + d cos(psi)) F / I, psi being the angle of G from straight out of
  the ramp. With F < 0 (it holds the cylinder back) and G past the top, as for the default
  numbers, that is downwards: a flight started there would enter the ground. With G before the
  top it is upwards. With any finite friction slipping comes first, and lift-off, if it comes,
  from the slip.

`contact_lost` finds the ideal event, `phases_of` gives the real chain for `phases.run`:
roll, slip (either way), fly, land, roll on. Landings keep no normal speed.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._arguments import like_defaults
from jaxdyn._floats import floats
from jaxdyn.effects import UniformGravity
from jaxdyn.events import Event, Stop, until
from jaxdyn.phases import Exit, Phase
from jaxdyn.scene import Scene
from jaxdyn.scenes.cylinders import CONTACTS, SLIPS, Cylinder

_DEPTH = 1e-12  # of the radius that a landing is late
_STICKS = 1e-9  # [1] slip over the speeds involved that is rounding


class NormalForce(Event):
    """The surface stops pushing: the normal force of a cylinder in contact falls to 0."""

    scene: Scene

    def value(self, t, y):
        return self.scene.system.reaction(t, y, self.scene.effects)[0]

    @property
    def direction(self):
        return -1


class Grip(Event):
    """Rolling needs more friction than mu N: against a slip along t (way 1) or back (-1)."""

    scene: Scene
    way: int = eqx.field(static=True)

    def value(self, t, y):
        normal, friction = self.scene.system.reaction(t, y, self.scene.effects)
        return self.scene.system.mu * normal + self.way * friction

    @property
    def direction(self):
        return -1


class Caught(Event):
    """A slip along t (way 1) or back (-1) comes to its end."""

    cylinder: Cylinder
    way: int = eqx.field(static=True)

    def value(self, t, y):
        del t
        return self.way * self.cylinder.slip(y)

    @property
    def direction(self):
        return -1


class Touches(Event):
    """A flying cylinder comes down on the surface, and a trillionth of its radius further.

    So it is clear of the event where a flight starts; a hop too short to be seen, of a cylinder
    that the surface hardly pushes, would else go on below the surface.
    """

    cylinder: Cylinder

    def value(self, t, y):
        del t
        return self.cylinder.height(y) + _DEPTH * self.cylinder.r

    @property
    def direction(self):
        return -1


class Landed(eqx.Module):
    """The state after a landing, as `Cylinder.landed`."""

    cylinder: Cylinder

    def __call__(self, t: Array, y: Array) -> Array:
        """(6,) state after the impact."""
        del t
        return self.cylinder.landed(y)


class Contact(eqx.Module):
    """How a cylinder in contact goes on: the number of its phase among `CONTACTS`."""

    scene: Scene

    def __call__(self, t: Array, y: Array) -> Array:
        """0 to roll, 1 to slip along t, 2 to slip back, 3 to fly where the surface would pull."""
        roll = self.scene.system
        slip = roll.slip(y)
        still = jnp.abs(slip) <= _STICKS * (jnp.abs(y[3]) + jnp.abs(y[4]) + roll.r * jnp.abs(y[5]))
        normal, friction = roll.reaction(t, y, self.scene.effects)
        way = jnp.where(still, -friction, slip)
        rolls = still & (jnp.abs(friction) <= roll.mu * normal)
        on, back = (_unpressed(self.scene, name, t, y) for name in SLIPS)
        lifts = jnp.where(
            still, _unpressed(self.scene, "roll", t, y), jnp.where(slip > 0, on, back)
        )
        return jnp.where(lifts, 3, jnp.where(rolls, 0, jnp.where(way > 0, 1, 2)))


class Loosens(eqx.Module):
    """How rolling ends where the grip does: 1 to fly, where there is no normal force, 0 to slip."""

    scene: Scene

    def __call__(self, t: Array, y: Array) -> Array:
        """The number of the phase."""
        return jnp.where(_unpressed(self.scene, "roll", t, y), 1, 0)


def _unpressed(scene: Scene, contact: str, t: Array, y: Array) -> Array:
    """Whether () a surface would not push a cylinder in contact, but for rounding."""
    system = scene.system.touching(contact)
    points = system.points(t, y)
    pulls = sum((jnp.sum(jnp.abs(e.force(t, *points))) for e in scene.effects), jnp.zeros(()))
    return system.reaction(t, y, scene.effects)[0] <= _STICKS * pulls


@like_defaults()
def cylinder_on_cylinder(*, m=1.0, r=0.5, fixed=1.0, mu=0.4, g=9.81, theta=0.1, t1=1.0) -> Scene:
    """A uniform cylinder that rolls down a fixed one, from rest (problem 37).

    Args:
      m: mass [kg].
      r: radius of the rolling cylinder [m].
      fixed: radius of the fixed cylinder, about the origin [m].
      mu: friction, for `phases_of`; rolling itself does not ask for it.
      g: gravity [m/s^2].
      theta: angle from the top at the start [rad].
      t1: span [s].
    """
    numbers = floats(m, m * r * r / 2, r, 0.0, fixed, 0.0, mu)
    far = r + fixed
    y0 = (far * math.sin(theta), far * math.cos(theta), 0.0, 0.0, 0.0, 0.0)
    return Scene(Cylinder(*numbers, "roll", flat=False), (UniformGravity(g),), y0=y0, t1=t1)


@like_defaults()
def cylinder_on_ramp(
    *, m=1.0, r=1.0, d=0.5, inertia=0.4, slope=0.2, mu=0.8, g=9.81, turn=0.0, spin=0.0, t1=3.0
) -> Scene:
    """A cylinder with its centre of mass off its centre, on a ramp (problem 38).

    Args:
      m: mass [kg].
      r: radius [m].
      d: distance of the centre of mass from the centre [m].
      inertia: about the centre of mass [kg m^2].
      slope: angle of the ramp below the horizontal, falling towards +x [rad].
      mu: friction, for `phases_of`; rolling itself does not ask for it.
      g: gravity [m/s^2].
      turn: angle of the centre of mass at the start, clockwise from straight out of the ramp
        [rad]; 0 is over the centre, pi under it.
      spin: angular velocity at the start [rad/s].
      t1: span [s].
    """
    numbers = floats(m, inertia, r, d, 1.0, slope, mu)
    phi = slope + turn
    x, y = r * math.sin(slope) + d * math.sin(phi), r * math.cos(slope) + d * math.cos(phi)
    vx = spin * (r * math.cos(slope) + d * math.cos(phi))
    vy = -spin * (r * math.sin(slope) + d * math.sin(phi))
    y0 = (x, y, phi, vx, vy, spin)
    return Scene(Cylinder(*numbers, "roll", flat=True), (UniformGravity(g),), y0=y0, t1=t1)


def contact_lost(scene: Scene, t1=None) -> Stop:
    """Where ideal rolling, with all the friction it needs, has no normal force left (37 b, 38 c).

    Args:
      scene: a rolling cylinder.
      t1: () end of the span [s]; the scene's own if left out.
    """
    return until(scene, NormalForce(scene), t1)


def friction_needed(scene: Scene, y: Array) -> Array:
    """() friction over normal force [1] that rolling needs in a state (problem 38 b)."""
    normal, friction = scene.system.touching("roll").reaction(jnp.zeros(()), y, scene.effects)
    return jnp.abs(friction) / normal


def phases_of(scene: Scene) -> dict[str, Phase]:
    """Roll, slip, fly, land and roll on, with the friction the scene has, for `phases.run`.

    ``run(phases_of(scene), "roll", scene.y0, t1)``. The start must be one that rolls.
    """

    def as_(contact):
        return Scene(scene.system.touching(contact), scene.effects, y0=scene.y0, t1=scene.t1)

    roll, fly = as_("roll"), as_("fly")
    goes_on = Contact(roll)
    loose = Loosens(roll)
    slips = tuple(
        Exit(Grip(roll, int(way)), (name, "fly"), choose=loose) for name, way in SLIPS.items()
    )
    phases = {"roll": Phase(roll, slips)}
    for name, way in SLIPS.items():
        slip = as_(name)
        caught = Exit(Caught(roll.system, int(way)), CONTACTS, choose=goes_on)
        phases[name] = Phase(slip, (caught, Exit(NormalForce(slip), "fly")))
    lands = Exit(Touches(fly.system), CONTACTS, Landed(fly.system), goes_on)
    return phases | {"fly": Phase(fly, (lands,))}
