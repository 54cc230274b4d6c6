"""A car that brakes with locked front or rear wheels, seen from above: course problem 32.

The two wheels of an axle act as one on the centre line. The free axle rolls: no velocity across
the car there, one rolling condition with one side force. The locked axle slides: friction
mu N against its velocity, N its share of the weight (the centre of mass is at ground height, so
braking does not move the load). Without friction both cars are the lecture's ideal one, a body
on one skate.

Is it stable (32 d)? Let V be the speed of the free axle, at s ahead of the centre of mass, and
omega the turning; L is the wheelbase and J = I + m s^2. For small turning

    J omega' = (m s V - mu N L^2 / V) omega,    m V' = -mu N,

the first part from the free axle, which leads if s > 0 and trails if s < 0, the second from the
friction, which always damps. With the front wheels locked the rear rolls, s < 0: any turning
dies out, the car is stable, at any speed. With the rear wheels locked s > 0 and turning grows
while V^2 > mu g L. From V0 to V it becomes

    omega = omega0 (V / V0)^(m L^2 / J) exp(m^2 s (V0^2 - V^2) / (2 mu N J)),

for the rear wheels so by up to about exp(m L V0^2 / (2 mu g J)).
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._arguments import like_defaults
from jaxdyn._floats import floats
from jaxdyn._numerics import safe_norm, square_norm
from jaxdyn.effects import unless_zero
from jaxdyn.events import Event
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.phases import END, Exit, Phase
from jaxdyn.scene import Effect, Points, Scene
from jaxdyn.scenes.skates import Skated

AXLES = ("front", "rear")


class LockedAxle(Effect):
    """Friction mu N against the velocity of the point `ahead` () [m] of a car's centre of mass.

    mu [1], load N () [N]. Acts on the coordinates (x, y, theta) of a planar body.

    Limits: 0 at rest, where the true force is whatever keeps the car there; end the motion by
    an event before.
    """

    mu: Array
    load: Array
    ahead: Array
    velocity_dependent: ClassVar[bool] = True

    def generalized(self, t, q, v):
        del t
        u = sliding_velocity(self.ahead, q, v)
        speed = safe_norm(u)
        fx, fy = -self.mu * self.load * u / jnp.where(speed == 0, 1.0, speed)
        moment = self.ahead * (jnp.cos(q[2]) * fy - jnp.sin(q[2]) * fx)
        return jnp.stack([fx, fy, moment])

    def check(self, points: Points) -> None:
        del points
        for name in ("mu", "load"):
            _checks.positive(name, getattr(self, name), "Leave the effect out for no friction.")


class Slow(Event):
    """The point `ahead` of a car's centre of mass slows down to a speed [m/s]."""

    ahead: Array
    speed: Array

    def value(self, t, y):
        del t
        return square_norm(sliding_velocity(self.ahead, y[:3], y[3:])) - self.speed**2

    @property
    def direction(self):
        return -1


class Stopped(eqx.Module):
    """The state with all velocities zero."""

    def __call__(self, t: Array, y: Array) -> Array:
        """The same place, at rest."""
        del t
        return jnp.concatenate([y[:3], jnp.zeros(3)])


def sliding_velocity(ahead: Array, q: Array, v: Array) -> Array:
    """(2,) velocity of the point `ahead` on a car's centre line; 0 only if the car is at rest."""
    return v[:2] + ahead * v[2] * jnp.stack([-jnp.sin(q[2]), jnp.cos(q[2])])


@like_defaults()
def car(
    *,
    locked="rear",
    to_front=1.2,
    to_rear=1.4,
    m=1000.0,
    inertia=1500.0,
    mu=0.7,
    g=9.81,
    speed=20.0,
    spin=0.01,
    t1=2.0,
) -> Scene:
    """A car whose front or rear wheels are locked, going along x (problem 32).

    Args:
      locked: "front" or "rear".
      to_front: distance from the centre of mass to the front axle [m].
      to_rear: distance from the centre of mass to the rear axle [m].
      m: mass [kg].
      inertia: about the centre of mass [kg m^2].
      mu: coefficient of friction of the locked wheels; exactly 0 leaves the friction out.
      g: gravity, which presses the wheels on the ground [m/s^2].
      speed: of the free axle [m/s].
      spin: initial turning, a disturbance [rad/s].
      t1: span [s]; it must end before the car stands still, see `braking`.
    """
    between = "The centre of mass is between the axles."
    front = _checks.positive("to_front", to_front, between)
    rear = -_checks.positive("to_rear", to_rear, between)
    _checks.choice("locked", locked, AXLES)
    slides, rolls = (front, rear) if locked == "front" else (rear, front)
    m, inertia = floats(m, inertia)
    at, axles = jnp.stack([rolls, 0 * rolls])[None], jnp.stack([front, rear])
    body = Skated(m, inertia, at, jnp.zeros(1), axles)
    # Balance of moments about the other axle.
    load = m * g * jnp.abs(rolls) / (front - rear)
    friction = LockedAxle(jnp.asarray(mu, dtype=float), load, slides)
    v = jnp.stack(floats(speed, -rolls * spin, spin))
    y0 = jnp.concatenate([jnp.zeros(3), v])
    return Scene(Constrained(body), unless_zero(mu, friction), y0=y0, t1=t1)


def braking(scene: Scene, *, fraction=1e-6) -> dict[str, Phase]:
    """The braking of a `car` down to rest, as a phase for `phases.run` (problem 32 b).

    ``run(braking(scene), "slide", scene.y0, 60.0)`` ends with the car at rest. The locked wheels
    slide until the car stands: their speed is 0 only if it turns no more either. The phase ends
    when that speed is the given fraction of what it was at the start; the rest of the way, of
    the order of its square, is left out.

    Args:
      scene: a `car` with friction.
      fraction: of the initial sliding speed that counts as standing still.
    Raises:
      ValueError: a car without friction, which never stops.
    """
    friction = next((e for e in scene.effects if isinstance(e, LockedAxle)), None)
    if friction is None:
        raise _checks.fail("scene", "a car with a locked axle", "none", "Give it mu > 0.")
    start = safe_norm(sliding_velocity(friction.ahead, scene.y0[:3], scene.y0[3:]))
    slow = Slow(friction.ahead, fraction * start)
    return {"slide": Phase(scene, (Exit(slow, END, Stopped()),))}


def turning_rate(scene: Scene, speed) -> Array:
    """Growth rate omega' / omega () [1/s] of a small turning at a speed [m/s] (problem 32 d).

    Positive: unstable.
    """
    body, (friction,) = scene.system.mechanism, scene.effects
    s = body.at[0, 0]
    base = s - friction.ahead
    j = body.inertia + body.m * s * s
    damping = friction.mu * friction.load * base * base / speed
    return (body.m * s * speed - damping) / j


def turning_left(scene: Scene, speed) -> Array:
    """How much of a small turning is left () [1] when a car has slowed down to a speed [m/s]."""
    body, (friction,) = scene.system.mechanism, scene.effects
    s, start = body.at[0, 0], scene.y0[3]
    j = body.inertia + body.m * s * s
    fall = speed / start
    power = body.m * (s - friction.ahead) ** 2 / j
    grip = friction.mu * friction.load
    return fall**power * jnp.exp(body.m**2 * s * (start**2 - speed**2) / (2 * grip * j))
