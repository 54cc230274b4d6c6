"""Impacts of a driven body: a ball on a table that goes up and down, an oscillator with a stop.

The phase of the drive is an entry of the state, an angle. The scenes are therefore autonomous, and
a motion that repeats itself in step with the drive is a closed orbit.

A body whose impacts get ever slower hits its wall infinitely often in a finite time. It then rests
on the wall, and leaves it when the wall would have to pull.

References: Holmes (1982), J. Sound Vib. 84, 173; Shaw and Holmes (1983), J. Sound Vib. 90, 129;
Nordmark (1991), J. Sound Vib. 145, 279.
"""

import abc
import dataclasses
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, check_first, floats
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.phase import Exit, Phase
from jaxdyn.joints import Load, particles
from jaxdyn.scene import Scene, System
from jaxdyn.scenes.ready_made import ready_made
from jaxdyn.sketch import Shape, rectangle
from jaxdyn.system import Points

#: Speed after an impact, relative to the largest speeds known at the start, below which a body
#: comes to rest. The bounces that are left out are 1e-16 as high as the largest.
_LEAST_BOUNCE = 1e-8


# ---- A body and its wall


class WalledBody(System):
    """A body on one side of a wall, or at rest on it: state [x, v, phase].

    Attributes:
      restitution: speed relative to the wall after an impact over that before [1].
      frequency: rate of the phase [rad/s].
      rests: whether the body rests on the wall, and moves with it.
    """

    restitution: Array = eqx.field(converter=as_float)
    frequency: Array = eqx.field(converter=as_float)
    rests: bool = eqx.field(static=True, default=False, kw_only=True)
    wall_name: ClassVar[str]
    #: 1 where x is larger on the body's side of the wall, -1 where it is smaller.
    side: ClassVar[int]

    @abc.abstractmethod
    def wall(self, phase: Array) -> Array:
        """() place of the wall [m]."""

    @abc.abstractmethod
    def acceleration(self, y: Array) -> Array:
        """() acceleration of the body without the wall [m/s^2]."""

    @abc.abstractmethod
    def largest_speed(self, y: Array) -> Array:
        """() an estimate of the largest speed relative to the wall [m/s] of a motion from y."""

    def rate(self, t, y, effects):
        del t, effects
        if self.rests:
            return self._rate_of(self.on_wall, y[2])
        return jnp.stack([y[1], self.acceleration(y), self.frequency])

    def on_wall(self, phase: Array) -> Array:
        """(3,) the state of a body at rest on the wall."""
        return jnp.stack([self.wall(phase), self._rate_of(self.wall, phase), phase])

    def push(self, phase: Array) -> Array:
        """() acceleration [m/s^2] by the wall, away from it, of a body that rests on it."""
        there = self.on_wall(phase)
        return self.side * (self._rate_of(self.on_wall, phase)[1] - self.acceleration(there))

    def gap(self, y: Array) -> Array:
        """() distance from the wall [m], negative beyond it."""
        return self.side * (y[0] - self.wall(y[2]))

    def project(self, t, y):
        del t
        return self.on_wall(y[2]) if self.rests else y

    def bounds(self, t, y, effects):
        del t, effects
        if self.rests:
            return {f"the lift-off from {self.wall_name}": self.push(y[2])}
        return {self.wall_name: self.gap(y)}

    def _rate_of(self, function: Callable[[Array], Array], phase: Array) -> Array:
        """The change in time of a function of the phase."""
        return jax.jvp(function, (phase,), (self.frequency,))[1]


class Impact(Event):
    """A body meets its wall."""

    body: WalledBody

    def value(self, t, y):
        del t
        return self.body.gap(y)

    @property
    def direction(self):
        return -1


class LiftOff(Event):
    """A wall would have to pull a body that rests on it."""

    body: WalledBody

    def value(self, t, y):
        del t
        return self.body.push(y[2])

    @property
    def direction(self):
        return -1


class AfterImpact(eqx.Module):
    """The state of a body after its impact on the wall.

    Attributes:
      body: the body.
      least: speed relative to the wall [m/s] below which the body comes to rest.
    """

    body: WalledBody
    least: Array

    def __call__(self, t: Array, y: Array) -> Array:
        """(3,) state after the impact."""
        x, v, phase = self.law(t, y)
        at_rest = self.body.on_wall(phase)
        rests = (jnp.abs(v - at_rest[1]) <= self.least) & (self.body.push(phase) > 0)
        return jnp.where(rests, at_rest, jnp.stack([x, v, phase]))

    def law(self, t: Array, y: Array) -> Array:
        """(3,) state after an impact that does not end in rest."""
        del t
        x, v, phase = y
        speed = self.body.on_wall(phase)[1]
        return jnp.stack([x, speed + self.body.restitution * (speed - v), phase])


def _phases(scene: Scene, impact: type[Impact], moving: str) -> dict[str, Phase]:
    """The phases of a body: at rest on its wall, and `moving` until it meets the wall.

    A start on the wall, with the velocity of the wall, is one at rest.
    """
    body = scene.system
    at_rest = dataclasses.replace(scene, system=dataclasses.replace(body, rests=True))
    least = _LEAST_BOUNCE * body.largest_speed(scene.y0)
    meets = Exit(impact(body), ("rest", moving), AfterImpact(body, least))
    return {
        "rest": Phase(at_rest, (Exit(LiftOff(body), moving),)),
        moving: Phase(scene, (meets,)),
    }


def _check_restitution(value) -> None:
    if not 0 <= float(value) <= 1:
        remedy = "It is the speed after an impact over that before."
        raise _checks.fail("restitution", "between 0 and 1", float(value), remedy)


# ---- A ball on a table


class BallOnTable(WalledBody):
    """A ball that falls freely above a table at the height A sin(phase), or lies on it.

    Attributes:
      amplitude: amplitude A of the table [m].
      g: gravity [m/s^2].
    """

    amplitude: Array = eqx.field(converter=as_float)
    g: Array = eqx.field(converter=as_float)
    wall_name: ClassVar[str] = "the table"
    side: ClassVar[int] = 1

    def labels(self):
        return ("y", "m"), ("vy", "m/s"), ("phase", "rad")

    def bodies(self, t, y):
        return particles(self.points(t, y).m, ("ball",))

    def loads(self, t, y):
        r, _, m = self.points(t, y)
        accelerations = {"weight": -self.g} | ({"table": self.push(y[2])} if self.rests else {})
        return tuple(
            Load(name, 0, jnp.stack([0.0 * self.g, a]) * m, r[0])
            for name, a in accelerations.items()
        )

    def wall(self, phase):
        return self.amplitude * jnp.sin(phase)

    def acceleration(self, y):
        del y
        return -self.g

    def largest_speed(self, y):
        fall = jnp.sqrt(y[1] ** 2 + 2 * jnp.abs(self.g * self.gap(y)))
        return fall + jnp.abs(self.amplitude * self.frequency)

    def points(self, t, y):
        del t  # energies are per mass
        zero = jnp.zeros(())
        return Points(jnp.stack([zero, y[0]])[None], jnp.stack([zero, y[1]])[None], jnp.ones(1))

    def energies(self, t, y, effects):
        del effects
        return self.kinetic(t, y), self.g * y[0]

    def sketch(self, t, y):
        del t
        half, height = self.amplitude, self.wall(y[2])
        ends = jnp.stack([jnp.stack([-half, height]), jnp.stack([half, height])])
        return (Shape("line", ends),)

    def check(self, t, y):
        del t, y
        _check_restitution(self.restitution)


class MeetsTable(Impact):
    """A ball comes down to the table."""

    called: ClassVar[str] = "impact on the table"


@ready_made()
def ball_on_table(
    *,
    restitution=0.8,
    amplitude=0.1,
    frequency=10.0,
    g=9.81,
    phase=0.0,
    velocity=3.0,
    t1=3.0,
) -> Scene:
    """A ball that bounces on a table which goes up and down, starting on the table.

    Its rate is that of a flight, also below the table: `phases_of` has its motion from bounce to
    bounce, for `jaxdyn.integrate.phases.simulate_phases`. With ``amplitude=0`` it is a floor.
    Bounces that get ever lower end at rest on the table. A ball that bounces once in n periods T
    of the table meets it at a phase at which the table rises at the speed
    g n T / 2 (1 - e) / (1 + e). Holmes (1982), J. Sound Vib. 84, 173.

    Args:
      restitution: e, the speed relative to the table after an impact over that before [1].
      amplitude: amplitude of the table [m].
      frequency: frequency of the table [rad/s].
      g: gravity [m/s^2].
      phase: phase of the table at the start, its height being amplitude sin(phase) [rad].
      velocity: velocity of the ball at the start, upwards [m/s].
      t1: span [s].
    """
    ball = BallOnTable(restitution, frequency, amplitude, g)
    phase, velocity = floats(phase, velocity)
    return Scene(ball, y0=jnp.stack([ball.wall(phase), velocity, phase]), t1=t1)


@check_first
def flight_phases(scene: Scene) -> dict[str, Phase]:
    """The phases of a `ball_on_table`: it lies on the table, or flies until it meets the table."""
    return _phases(scene, MeetsTable, "fly")


# ---- An oscillator with a stop


def _level(x: Array) -> Array:
    """(2,) a vector along the x axis."""
    return jnp.stack([x, jnp.zeros_like(x)])


class ImpactOscillator(WalledBody):
    """A mass on a spring with a damper and a force F cos(phase), to the left of a stop.

    Attributes:
      m: mass [kg].
      c: coefficient of the damper [kg/s].
      k: stiffness of the spring [N/m].
      force: amplitude F of the force [N].
      stop: x of the stop [m]; the spring is relaxed at 0.
    """

    m: Array = eqx.field(converter=as_float)
    c: Array = eqx.field(converter=as_float)
    k: Array = eqx.field(converter=as_float)
    force: Array = eqx.field(converter=as_float)
    stop: Array = eqx.field(converter=as_float)
    wall_name: ClassVar[str] = "the stop"
    side: ClassVar[int] = -1

    def labels(self):
        return ("x", "m"), ("vx", "m/s"), ("phase", "rad")

    def bodies(self, t, y):
        del t, y
        return particles(self.m[None], ("mass",))

    def loads(self, t, y):
        del t
        x, v, phase = y
        forces = {
            "spring": -self.k * x,
            "damper": -self.c * v,
            "drive": self.force * jnp.cos(phase),
        }
        if self.rests:
            forces["stop"] = -self.m * self.push(phase)
        return tuple(Load(name, 0, _level(force), _level(x)) for name, force in forces.items())

    def wall(self, phase):
        del phase
        return self.stop

    def acceleration(self, y):
        x, v, phase = y
        return (self.force * jnp.cos(phase) - self.k * x - self.c * v) / self.m

    def largest_speed(self, y):
        x, v, _ = y
        work = self.k * (x**2 + self.stop**2) / 2 + jnp.abs(self.force * (x - self.stop))
        w = jnp.abs(self.frequency)
        w = jnp.where(w > 0, w, jnp.inf)
        return jnp.sqrt(v**2 + 2 * work / self.m) + jnp.abs(self.force) / (self.m * w)

    def points(self, t, y):
        del t
        return Points(_level(y[0])[None], _level(y[1])[None], self.m[None])

    def energies(self, t, y, effects):
        del effects
        return self.kinetic(t, y), 0.5 * self.k * y[0] ** 2

    def sketch(self, t, y):
        del t
        # The coordinate is that of the right face; the wall is drawn where the mass rarely comes.
        known = self.k > 0
        static = jnp.abs(jnp.where(known, self.force / jnp.where(known, self.k, 1.0), 0.0))
        size = static + jnp.abs(self.stop)
        size = jnp.where(size > 0, size, 1.0)
        wide, high, wall, face = 0.3 * size, 0.5 * size, -2.0 * size, y[0] - 0.3 * size

        ends = jnp.stack([_level(wall), _level(face)])

        def plate(left):
            return rectangle("solid", (0.1 * size, 1.5 * high), _level(left + 0.05 * size))

        floor = jnp.stack([jnp.stack([end, -0.5 * high]) for end in (wall, self.stop)])
        return (
            Shape("ground", floor),
            plate(wall - 0.1 * size),
            plate(self.stop),
            Shape("spring", ends),
            Shape("dashpot", ends),
            rectangle("area", (wide, high), _level(y[0] - 0.5 * wide)),
        )

    def check(self, t, y):
        del t, y
        _checks.positive("m", self.m)
        _check_restitution(self.restitution)


class MeetsStop(Impact):
    """An oscillator reaches its stop."""

    called: ClassVar[str] = "impact on the stop"


@ready_made()
def impact_oscillator(
    *,
    m=1.0,
    c=0.1,
    k=1.0,
    force=1.0,
    frequency=2.6,
    stop=0.0,
    restitution=0.8,
    x=0.0,
    velocity=-0.5,
    phase=0.0,
    t1=20.0,
) -> Scene:
    """A driven mass on a spring that hits a stop on its right.

    Its rate does not include the stop: `phases_of` has its motion from impact to impact, for
    `jaxdyn.integrate.phases.simulate_phases`. Without impacts it oscillates with the amplitude
    F / sqrt((k - m w^2)^2 + (c w)^2), and it grazes a stop at this distance. Shaw and Holmes
    (1983), J. Sound Vib. 90, 129; Nordmark (1991), J. Sound Vib. 145, 279.

    Args:
      m: mass [kg].
      c: coefficient of the damper [kg/s].
      k: stiffness of the spring [N/m].
      force: amplitude F of the force F cos(phase) [N].
      frequency: w of the force [rad/s].
      stop: x of the stop [m]; the spring is relaxed at x = 0.
      restitution: speed after an impact over that before [1].
      x: initial x, at most `stop` [m].
      velocity: velocity at the start [m/s].
      phase: phase of the force at the start [rad].
      t1: span [s].
    """
    oscillator = ImpactOscillator(restitution, frequency, m, c, k, force, stop)
    return Scene(oscillator, y0=jnp.stack(floats(x, velocity, phase)), t1=t1)


@check_first
def impact_phases(scene: Scene) -> dict[str, Phase]:
    """The phases of an `impact_oscillator`: it swings until it meets its stop, or rests on it."""
    return _phases(scene, MeetsStop, "swing")
