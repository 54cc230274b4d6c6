"""Walking down a slope without motors: the rimless wheel, and the simplest walker.

Between two steps each is an inverted pendulum about the foot on the ground. A step is an impact
without slip or rebound in which the other foot comes to the ground as the first one leaves it: the
angular momentum about the new foot is conserved, the energy is not. The state has no position: each
step is described relative to its own foot.

- The rimless wheel of n spokes, 2 a = 2 pi / n apart, keeps the fraction cos 2a of its angular
  velocity in a step. Its gait has the angular velocity 2 cot 2a sqrt(g/l sin a sin slope) after a
  step, and the multiplier cos^2 2a. A wheel that is too slow rocks from spoke to spoke, infinitely
  often in a finite time, and then rests on two of them. On a slope of a or more it rolls on.
- The simplest walker has two legs, a mass at the hip and far smaller ones at the feet, so that the
  swing leg does not act on the stance leg. Its knees are stiff, so the swing foot passes through
  the ground when the legs are parallel; this is ignored.

References: McGeer (1990), Int. J. Robotics Research 9(2), 62; Garcia, Chatterjee, Ruina and Coleman
(1998), J. Biomech. Eng. 120, 281.
"""

import abc
import dataclasses
import math
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, check_first, floats
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.phase import Exit, Phase
from jaxdyn.joints import Load, particles, rod
from jaxdyn.scene import Scene, System
from jaxdyn.scenes.ready_made import RENAMED, ready_made
from jaxdyn.sketch import Shape
from jaxdyn.system import Points


def _along(angle: Array) -> Array:
    """(2,) the direction at an angle from straight up, clockwise."""
    return jnp.stack([jnp.sin(angle), jnp.cos(angle)])


def _ground(slope: Array, l: Array) -> Shape:  # noqa: E741
    along = l * _along(slope + jnp.pi / 2)
    return Shape("ground", jnp.stack([-along, along]))


class StandsOnFoot(System):
    """A mass on a leg, whose foot is at the origin: an inverted pendulum.

    Attributes:
      slope: angle of the ground below the horizontal, falling towards +x [rad].
      l: length of a leg [m].
      g: gravity [m/s^2].
    """

    slope: Array = eqx.field(converter=as_float)
    l: Array = eqx.field(converter=as_float)  # noqa: E741
    g: Array = eqx.field(converter=as_float)
    #: What the mass and the leg are called.
    mass_called: ClassVar[str]
    leg_called: ClassVar[str]

    @abc.abstractmethod
    def lean(self, y: Array) -> tuple[Array, Array]:
        """The angle of the leg from straight up, clockwise [rad], and its rate."""

    def points(self, t, y):
        del t  # energies are per mass
        angle, rate = self.lean(y)
        across = jnp.stack([jnp.cos(angle), -jnp.sin(angle)])
        return Points(self.l * _along(angle)[None], self.l * rate * across[None], jnp.ones(1))

    def bodies(self, t, y):
        return particles(self.points(t, y).m, (self.mass_called,))

    def joints(self, t, y):
        return (rod(self.leg_called, 0, None, (jnp.zeros(2), self.points(t, y).r[0])),)

    def loads(self, t, y):
        r, _, m = self.points(t, y)
        return (Load("weight", 0, jnp.stack([jnp.zeros_like(self.g), -self.g * m[0]]), r[0]),)

    def energies(self, t, y, effects):
        del effects
        return self.kinetic(t, y), self.g * self.l * jnp.cos(self.lean(y)[0])

    def check(self, t, y):
        del t, y
        _checks.positive("length", self.l)


# ---- The rimless wheel

#: Angular velocity after an impact, relative to the largest at the start, below which a wheel comes
#: to rest. The steps that are left out are 1e-14 as high as the largest. At 1e-8 they would be lost
#: in the rounding of the angle, and the wheel might rock on for ever.
_LEAST_RATE = 1e-7


class RimlessWheel(StandsOnFoot):
    """A wheel of equal spokes without a rim, with its mass at the hub, standing on one spoke.

    Attributes:
      spokes: number of spokes.
      rests: whether it rests on two spokes.
    """

    spokes: int = eqx.field(static=True)
    rests: bool = eqx.field(static=True, default=False)
    mass_called = "hub"
    leg_called = "spoke"

    def labels(self):
        return ("theta", "rad"), ("omega", "rad/s")

    @property
    def half(self) -> float:
        """Half of the angle between two spokes [rad]."""
        return math.pi / self.spokes

    @property
    def second_order(self):
        return not self.rests

    def rate(self, t, y, effects):
        del t, effects
        if self.rests:
            return jnp.zeros_like(y)
        theta, omega = y
        return jnp.stack([omega, self.g / self.l * jnp.sin(theta)])

    def on_two_spokes(self, y: Array) -> Array:
        """(2,) the state of a wheel at rest on its spoke and on the one that is nearer to landing.

        The state is relative to the same spoke as y.
        """
        ahead = y[0] >= self.slope
        return jnp.stack([self.slope + jnp.where(ahead, self.half, -self.half), 0.0 * y[1]])

    def room(self) -> Array:
        """() angle [rad] from straight below the hub to the nearer of the two feet at rest."""
        return self.half - jnp.abs(self.slope)

    def project(self, t, y):
        del t
        return self.on_two_spokes(y) if self.rests else y

    def lean(self, y):
        return y[0], y[1]

    def sketch(self, t, y):
        hub = self.points(t, y).r[0]
        turns = jnp.pi + y[0] + 2 * self.half * jnp.arange(self.spokes, dtype=float)
        ends = hub[None] + self.l * jnp.stack([jnp.sin(turns), jnp.cos(turns)], axis=1)
        spokes = jnp.stack([jnp.broadcast_to(hub[None], ends.shape), ends], axis=1)
        return Shape("line", spokes), _ground(self.slope, self.l)

    def bounds(self, t, y, effects):
        del t, effects
        if self.rests:
            return {"the tipping of the wheel": self.room()}
        return {"the impact of the next spoke": self.half - jnp.abs(y[0] - self.slope)}

    def check(self, t, y):
        super().check(t, y)
        _checks.whole("spokes", self.spokes, least=5, remedy="With fewer no spoke lets it roll on.")


class SpokeLands(Event):
    """The next spoke reaches the ground, ahead (way 1) or behind (-1)."""

    wheel: RimlessWheel
    way: int = eqx.field(static=True)
    called: ClassVar[str] = "impact of the next spoke"

    def value(self, t, y):
        del t
        return y[0] - (self.wheel.slope + self.way * self.wheel.half)

    @property
    def direction(self):
        return self.way


class Tips(Event):
    """The hub of a wheel at rest is not between its two feet."""

    wheel: RimlessWheel

    def value(self, t, y):
        del t, y
        return self.wheel.room()

    @property
    def direction(self):
        return -1


class NextSpoke(eqx.Module):
    """The state of a rimless wheel on its next spoke, ahead (way 1) or behind (-1).

    Attributes:
      wheel: the wheel.
      way: 1 or -1.
      least: angular velocity [rad/s] below which it comes to rest.
    """

    wheel: RimlessWheel
    way: int = eqx.field(static=True)
    least: Array

    def __call__(self, t: Array, y: Array) -> Array:
        """(2,) state after the impact."""
        after = self.law(t, y)
        rests = (jnp.abs(after[1]) <= self.least) & (self.wheel.room() > 0)
        return jnp.where(rests, self.wheel.on_two_spokes(after), after)

    def law(self, t: Array, y: Array) -> Array:
        """(2,) state after an impact that does not end in rest."""
        del t
        between = 2 * self.wheel.half
        return jnp.stack([y[0] - self.way * between, math.cos(between) * y[1]])


@ready_made(renamed=RENAMED)
def rimless_wheel(*, spokes=8, slope=0.08, length=1.0, g=1.0, omega=0.4, t1=5.0) -> Scene:
    """A wheel of spokes without a rim that rolls down a slope, on one spoke after the other.

    It starts on a spoke that has just landed. Its rate is that of one step: `phases_of` has its
    motion from step to step, and its rest where it is too slow to roll on, for
    `jaxdyn.integrate.phases.simulate_phases`. With the default numbers the gait has the angular
    velocity 0.3497543674325097 after a step, and the multiplier 1/2. McGeer (1990), Int. J.
    Robotics Research 9(2), 62.

    Args:
      spokes: number of spokes, at least 5.
      slope: angle of the ground below the horizontal, falling towards +x [rad].
      length: length of a spoke [m].
      g: gravity [m/s^2].
      omega: angular velocity at the start, down the slope [rad/s].
      t1: span [s].
    """
    spokes = _checks.whole("spokes", spokes, least=5, remedy="With fewer it does not roll on.")
    wheel = RimlessWheel(slope, length, g, spokes)
    return Scene(wheel, y0=jnp.stack([slope - wheel.half, as_float(omega)]), t1=t1)


@check_first
def roll_phases(scene: Scene) -> dict[str, Phase]:
    """The phases of a `rimless_wheel`: at rest, and a roll that a spoke ahead or behind it ends."""
    wheel = scene.system
    at_rest = dataclasses.replace(scene, system=dataclasses.replace(wheel, rests=True))
    least = _LEAST_RATE * jnp.sqrt(wheel.g / wheel.l + scene.y0[1] ** 2)
    exits = [
        Exit(SpokeLands(wheel, way), ("rest", "roll"), NextSpoke(wheel, way, least))
        for way in (1, -1)
    ]
    return {
        "rest": Phase(at_rest, (Exit(Tips(wheel), "roll"),)),
        "roll": Phase(scene, tuple(exits)),
    }


# ---- The simplest walker


class SimplestWalker(StandsOnFoot):
    """Two legs with a mass at the hip and feet of no mass, one foot on the ground.

    Angles are counterclockwise, that of the stance leg from the normal of the ground and that of
    the swing leg from the stance leg, so that both decrease in a step towards +x.
    """

    mass_called = "hip"
    leg_called = "stance leg"

    def labels(self):
        names = "stance", "swing"
        return *((name, "rad") for name in names), *((f"{name}_rate", "rad/s") for name in names)

    def rate(self, t, y, effects):
        del t, effects
        stance, swing, stance_rate, swing_rate = y
        pull = self.g / self.l
        turn = pull * jnp.sin(stance - self.slope)
        hang = stance_rate**2 - pull * jnp.cos(stance - self.slope)
        return jnp.stack([stance_rate, swing_rate, turn, turn + hang * jnp.sin(swing)])

    def lean(self, y):
        return self.slope - y[0], -y[2]

    def sketch(self, t, y):
        hip = self.points(t, y).r[0]
        foot = hip - self.l * _along(self.slope - y[0] + y[1])
        legs = jnp.stack([jnp.zeros(2), hip, foot])
        return (
            Shape("line", legs),
            _ground(self.slope, self.l),
            Shape("trace", hip[None], "hip"),
            Shape("trace", foot[None], "swing foot"),
        )

    def bounds(self, t, y, effects):
        del t, effects
        return {"the strike of the other foot": 2 * y[0] - y[1]}


class HeelStrikes(Event):
    """The swing foot comes down to the ground, as opposed to leaving it or scuffing it."""

    called: ClassVar[str] = "heel strike"

    def value(self, t, y):
        del t
        return y[1] - 2 * y[0]

    @property
    def direction(self):
        return 1


def changes_feet(t: Array, y: Array) -> Array:
    """(4,) the state of a `SimplestWalker` on its other foot, after the impact."""
    del t
    stance, _, rate, _ = y
    kept = jnp.cos(2 * stance)
    return jnp.stack([-stance, -2 * stance, kept * rate, kept * (1 - kept) * rate])


@ready_made(renamed=RENAMED)
def simplest_walker(
    *,
    slope=0.009,
    length=1.0,
    g=1.0,
    stance=0.2,
    rate=-0.2,
    t1=4.0,
) -> Scene:
    """Two legs that walk down a slope without a motor, on one foot after the other.

    It starts just after a step. Its rate is that of one step: `phases_of` has its motion from step
    to step, for `jaxdyn.integrate.phases.simulate_phases`. The gait on the slope 0.009 has the
    angle 0.20031090054424716 and the rate -0.19983247300495 after a step; the gait is stable up to
    a slope of 0.0150884379, where its period doubles. Garcia et al. (1998), J. Biomech. Eng. 120,
    281.

    Args:
      slope: angle of the ground below the horizontal, falling towards +x [rad].
      length: length of a leg [m].
      g: gravity [m/s^2].
      stance: angle of the leg that has come to the ground, counterclockwise from the normal of the
        ground [rad].
      rate: rate of that angle [rad/s].
      t1: span [s].
    """
    stance, rate = floats(stance, rate)
    kept = jnp.cos(2 * stance)
    y0 = jnp.stack([stance, 2 * stance, rate, (1 - kept) * rate])
    return Scene(SimplestWalker(slope, length, g), y0=y0, t1=t1)


@check_first
def walk_phases(scene: Scene) -> dict[str, Phase]:
    """The motion of a `simplest_walker` as a phase, which the strike of the other foot ends."""
    # The swing foot passes below the ground, where the knee of another walker would bend, so the
    # ground is no bound.
    strikes = Exit(HeelStrikes(), "swing", changes_feet, one_sided=False)
    return {"swing": Phase(scene, (strikes,))}
