"""Impacts of a driven body: a ball on a table that goes up and down, an oscillator with a stop.

The phase of the drive is an entry of the state, an angle. The scenes are therefore autonomous, and
a motion that repeats itself in step with the drive is a closed orbit.

References: Holmes (1982), J. Sound Vib. 84, 173; Shaw and Holmes (1983), J. Sound Vib. 90, 129;
Nordmark (1991), J. Sound Vib. 145, 279.
"""

from typing import ClassVar

import equinox as eqx
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


def _check_restitution(value) -> None:
    if not 0 <= float(value) <= 1:
        remedy = "It is the speed after an impact over that before."
        raise _checks.fail("restitution", "between 0 and 1", float(value), remedy)


# ---- A ball on a table


class BallOnTable(System):
    """A ball that falls freely above a table at the height A sin(phase).

    Attributes:
      restitution: speed relative to the table after an impact over that before [1].
      amplitude: amplitude A of the table [m].
      frequency: frequency of the table [rad/s].
      g: gravity [m/s^2].
    """

    restitution: Array = eqx.field(converter=as_float)
    amplitude: Array = eqx.field(converter=as_float)
    frequency: Array = eqx.field(converter=as_float)
    g: Array = eqx.field(converter=as_float)

    def labels(self):
        return ("y", "m"), ("vy", "m/s"), ("phase", "rad")

    def rate(self, t, y, effects):
        del t, effects
        return jnp.stack([y[1], -self.g, self.frequency])

    def bodies(self, t, y):
        return particles(self.points(t, y).m, ("ball",))

    def loads(self, t, y):
        r, _, m = self.points(t, y)
        return (Load("weight", 0, jnp.stack([0.0 * self.g, -self.g]) * m, r[0]),)

    def table(self, phase: Array) -> tuple[Array, Array]:
        """() height [m] and () velocity [m/s] of the table."""
        height = self.amplitude * jnp.sin(phase)
        return height, self.amplitude * self.frequency * jnp.cos(phase)

    def points(self, t, y):
        del t  # energies are per mass
        zero = jnp.zeros(())
        return Points(jnp.stack([zero, y[0]])[None], jnp.stack([zero, y[1]])[None], jnp.ones(1))

    def energies(self, t, y, effects):
        del effects
        return self.kinetic(t, y), self.g * y[0]

    def sketch(self, t, y):
        del t
        half, height = self.amplitude, self.table(y[2])[0]
        ends = jnp.stack([jnp.stack([-half, height]), jnp.stack([half, height])])
        return (Shape("line", ends),)

    def bounds(self, t, y, effects):
        del t, effects
        return {"the table": y[0] - self.table(y[2])[0]}

    def check(self, t, y):
        del t, y
        _check_restitution(self.restitution)


class MeetsTable(Event):
    """A ball comes down to the table."""

    ball: BallOnTable
    called: ClassVar[str] = "impact on the table"

    def value(self, t, y):
        del t
        return y[0] - self.ball.table(y[2])[0]

    @property
    def direction(self):
        return -1


class OffTable(eqx.Module):
    """The state of a ball after its impact on the table."""

    ball: BallOnTable

    def __call__(self, t: Array, y: Array) -> Array:
        """(3,) state after the impact."""
        del t
        speed = self.ball.table(y[2])[1]
        return jnp.stack([y[0], speed - self.ball.restitution * (y[1] - speed), y[2]])


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
    bounce, for `jaxdyn.integrate.phases.simulate_phases`. A ball that bounces once in n periods T
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
    ball = BallOnTable(restitution, amplitude, frequency, g)
    phase, velocity = floats(phase, velocity)
    return Scene(ball, y0=jnp.stack([ball.table(phase)[0], velocity, phase]), t1=t1)


@check_first
def flight_phases(scene: Scene) -> dict[str, Phase]:
    """The flight of a `ball_on_table` as a phase, which an impact on the table ends."""
    ball = scene.system
    return {"fly": Phase(scene, (Exit(MeetsTable(ball), "fly", OffTable(ball)),))}


# ---- An oscillator with a stop


def _level(x: Array) -> Array:
    """(2,) a vector along the x axis."""
    return jnp.stack([x, jnp.zeros_like(x)])


class ImpactOscillator(System):
    """A mass on a spring with a damper and a force F cos(phase), to the left of a stop.

    Attributes:
      m: mass [kg].
      c: coefficient of the damper [kg/s].
      k: stiffness of the spring [N/m].
      force: amplitude F of the force [N].
      frequency: frequency of the force [rad/s].
      stop: x of the stop [m]; the spring is relaxed at 0.
      restitution: speed after an impact over that before [1].
    """

    m: Array = eqx.field(converter=as_float)
    c: Array = eqx.field(converter=as_float)
    k: Array = eqx.field(converter=as_float)
    force: Array = eqx.field(converter=as_float)
    frequency: Array = eqx.field(converter=as_float)
    stop: Array = eqx.field(converter=as_float)
    restitution: Array = eqx.field(converter=as_float)

    def labels(self):
        return ("x", "m"), ("vx", "m/s"), ("phase", "rad")

    def rate(self, t, y, effects):
        del t, effects
        x, v, phase = y
        pull = self.force * jnp.cos(phase) - self.k * x - self.c * v
        return jnp.stack([v, pull / self.m, self.frequency])

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
        return tuple(Load(name, 0, _level(force), _level(x)) for name, force in forces.items())

    def points(self, t, y):
        del t
        return Points(_level(y[0])[None], _level(y[1])[None], self.m[None])

    def energies(self, t, y, effects):
        del effects
        return self.kinetic(t, y), 0.5 * self.k * y[0] ** 2

    def sketch(self, t, y):
        del t
        # The point of the mass is its right face; the wall stands where the mass rarely comes.
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

    def bounds(self, t, y, effects):
        del t, effects
        return {"the stop": self.stop - y[0]}

    def check(self, t, y):
        del t, y
        _checks.positive("m", self.m)
        _check_restitution(self.restitution)


class MeetsStop(Event):
    """An oscillator reaches its stop."""

    oscillator: ImpactOscillator
    called: ClassVar[str] = "impact on the stop"

    def value(self, t, y):
        del t
        return y[0] - self.oscillator.stop

    @property
    def direction(self):
        return 1


class AfterImpact(eqx.Module):
    """The state of an oscillator after its impact on the stop."""

    oscillator: ImpactOscillator

    def __call__(self, t: Array, y: Array) -> Array:
        """(3,) state after the impact."""
        del t
        return jnp.stack([y[0], -self.oscillator.restitution * y[1], y[2]])


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

    Its rate does not know the stop: `phases_of` has its motion from impact to impact, for
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
    oscillator = ImpactOscillator(m, c, k, force, frequency, stop, restitution)
    return Scene(oscillator, y0=jnp.stack(floats(x, velocity, phase)), t1=t1)


@check_first
def impact_phases(scene: Scene) -> dict[str, Phase]:
    """The motion of an `impact_oscillator` as a phase, which an impact on its stop ends."""
    oscillator = scene.system
    hits = Exit(MeetsStop(oscillator), "swing", AfterImpact(oscillator))
    return {"swing": Phase(scene, (hits,))}
