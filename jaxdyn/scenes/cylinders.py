"""Cylinders that roll on a fixed cylinder or down a ramp until they slip: problems 37 and 38.

The answers, and corrections to the course:

- 37 a: yes, the equation is that of an inverted pendulum of length R + r with g scaled by 2/3:
  (3/2)(R + r) theta'' = g sin theta. Energy and geometry give an equation for theta alone, and
  rolling adds half of the mass to the inertia. 37 b: contact is lost at cos theta = 4/7 (from rest
  at the top). But the ratio of friction to normal force in rolling is sin theta / (7 cos theta -
  4): rolling to that point needs unbounded friction. With a finite coefficient the cylinder slips
  first. With an inertia k m r^2 instead of m r^2 / 2, 3/2 becomes 1 + k, contact ends at cos theta
  = 2 / (3 + k), and the ratio is k sin theta / ((3 + k) cos theta - 2). Without friction it does
  not turn, as if k were 0, and leaves at cos theta = 2/3. From rest at a steep angle, tan theta >
  (1 + k) mu / k, it slips immediately.
- 38 c: where the normal force of ideal rolling vanishes, the friction F does not, so removing the
  surface changes the motion there: the cylinder would leave the ramp with the acceleration d
  sin(psi) (r + d cos(psi)) F / I, with psi the angle of G from the normal of the ramp. With F < 0
  (it holds the cylinder back) and G past the top, as for the default numbers, that is downwards: a
  flight started there would enter the ground. With G before the top it is upwards. With a finite
  coefficient of friction slipping comes first, and lift-off, if any, follows from the slip.

`contact_lost` finds the ideal event; `contact_phases` gives the real phases for `simulate_phases`:
roll, slip (in either direction), fly, land, roll on. The initial phase, and the next one after each
event, is the first that the state fits: with friction within its cone, a normal force that pushes,
or a slip in the right direction. Landings are inelastic.
"""

import dataclasses
import math
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._checks import as_float, check_first
from jaxdyn.effects import UniformGravity
from jaxdyn.integrate.events import Event, Stop, until
from jaxdyn.integrate.phase import Exit, Phase
from jaxdyn.mechanisms.cylinders import CONTACTS, SLIPS, Cylinder
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import ready_made


class NormalForce(Event):
    """The normal force of a cylinder in contact falls to 0."""

    scene: Scene
    called: ClassVar[str] = "lift-off"

    def value(self, t, y):
        return self.scene.system.reaction(t, y, self.scene.effects)[0]

    @property
    def direction(self):
        return -1


class FrictionLimit(Event):
    """The friction of rolling reaches mu N, against a slip along t (way 1) or against t (-1)."""

    scene: Scene
    way: int = eqx.field(static=True)
    called: ClassVar[str] = "slipping"

    def value(self, t, y):
        normal, friction = self.scene.system.reaction(t, y, self.scene.effects)
        return self.scene.system.mu * normal + self.way * friction

    @property
    def direction(self):
        return -1


class SlipEnds(Event):
    """A slip along t (way 1) or against t (-1) ends."""

    cylinder: Cylinder
    way: int = eqx.field(static=True)

    def value(self, t, y):
        del t
        return self.way * self.cylinder.slip(y)

    @property
    def direction(self):
        return -1


class Touches(Event):
    """A flying cylinder reaches the surface."""

    cylinder: Cylinder
    called: ClassVar[str] = "landing"

    def value(self, t, y):
        del t
        return self.cylinder.height(y)

    @property
    def direction(self):
        return -1


class AfterLanding(eqx.Module):
    """The state after a landing, by `Cylinder.after_landing`."""

    cylinder: Cylinder

    def __call__(self, t: Array, y: Array) -> Array:
        """(6,) state after the impact."""
        del t
        return self.cylinder.after_landing(y)


@ready_made()
def cylinder_on_cylinder(
    *, m=1.0, r=0.5, inertia_ratio=0.5, fixed=1.0, mu=0.4, g=9.81, theta=0.1, t1=1.0
) -> Scene:
    """A cylinder that rolls down a fixed one, from rest (problem 37).

    Args:
      m: mass [kg].
      r: radius of the rolling cylinder [m].
      inertia_ratio: moment of inertia about its axis over m r^2 [1]; 0.5 for a solid cylinder, 1
        for a thin tube.
      fixed: radius of the fixed cylinder, about the origin [m].
      mu: coefficient of friction [1], for `phases_of`; rolling itself does not depend on it.
      g: gravity [m/s^2].
      theta: angle from the top at the start [rad].
      t1: span [s].
    """
    cylinder = Cylinder(
        m=as_float(m),
        inertia=as_float(inertia_ratio * m * r * r),
        r=as_float(r),
        d=as_float(0.0),
        fixed=as_float(fixed),
        slope=as_float(0.0),
        mu=as_float(mu),
        contact="roll",
        flat=False,
    )
    far = r + fixed
    y0 = (far * math.sin(theta), far * math.cos(theta), 0.0, 0.0, 0.0, 0.0)
    return Scene(cylinder, (UniformGravity(g),), y0=y0, t1=t1)


@ready_made()
def cylinder_on_ramp(
    *, m=1.0, r=1.0, d=0.5, inertia=0.4, slope=0.2, mu=0.8, g=9.81, turn=0.0, spin=0.0, t1=3.0
) -> Scene:
    """A cylinder with its centre of mass off its centre, on a ramp (problem 38).

    Args:
      m: mass [kg].
      r: radius [m].
      d: distance of the centre of mass from the centre [m].
      inertia: moment of inertia about the centre of mass [kg m^2].
      slope: angle of the ramp below the horizontal, falling towards +x [rad].
      mu: coefficient of friction [1], for `phases_of`; rolling itself does not depend on it.
      g: gravity [m/s^2].
      turn: angle of the centre of mass at the start, clockwise from the normal of the ramp
        [rad]; 0 is above the centre, pi below it.
      spin: angular velocity at the start [rad/s].
      t1: span [s].
    """
    cylinder = Cylinder(
        m=as_float(m),
        inertia=as_float(inertia),
        r=as_float(r),
        d=as_float(d),
        fixed=as_float(1.0),
        slope=as_float(slope),
        mu=as_float(mu),
        contact="roll",
        flat=True,
    )
    phi = slope + turn
    x, y = r * math.sin(slope) + d * math.sin(phi), r * math.cos(slope) + d * math.cos(phi)
    vx = spin * (r * math.cos(slope) + d * math.cos(phi))
    vy = -spin * (r * math.sin(slope) + d * math.sin(phi))
    y0 = (x, y, phi, vx, vy, spin)
    return Scene(cylinder, (UniformGravity(g),), y0=y0, t1=t1)


@check_first
def contact_lost(scene: Scene, t1=None) -> Stop:
    """Where the normal force of ideal rolling, with unlimited friction, vanishes (37 b, 38 c).

    Args:
      scene: a rolling cylinder.
      t1: () end of the span [s]; that of the scene by default.
    """
    return until(scene, NormalForce(scene), t1)


@check_first
def friction_needed(scene: Scene, y: Array) -> Array:
    """() ratio [1] of friction to normal force in rolling, in a state (problem 38 b)."""
    normal, friction = scene.system.with_contact("roll").reaction(jnp.zeros(()), y, scene.effects)
    return jnp.abs(friction) / normal


@check_first
def contact_phases(scene: Scene) -> dict[str, Phase]:
    """The phases roll, slip (in either direction) and fly of a cylinder in contact.

    A motion starts with the first phase that the state fits: the cylinder rolls if it does not slip
    and friction suffices, otherwise it slips; it flies where the surface would have to pull.
    """

    def as_(contact):
        return dataclasses.replace(scene, system=scene.system.with_contact(contact))

    roll, fly = as_("roll"), as_("fly")
    grips = tuple(Exit(FrictionLimit(roll, int(way)), CONTACTS) for way in SLIPS.values())
    phases = {"roll": Phase(roll, (*grips, Exit(NormalForce(roll), CONTACTS)))}
    for name, way in SLIPS.items():
        slip = as_(name)
        caught = Exit(SlipEnds(roll.system, int(way)), CONTACTS)
        phases[name] = Phase(slip, (caught, Exit(NormalForce(slip), CONTACTS)))
    lands = Exit(Touches(fly.system), CONTACTS, AfterLanding(fly.system))
    return phases | {"fly": Phase(fly, (lands,))}
