"""A car that brakes with locked front or rear wheels, seen from above: course problem 32.

The two wheels of an axle act as one on the centre line. The free axle rolls: its velocity has no
lateral component, which is one rolling condition with one side force. The locked axle slides, with
friction mu N against its velocity, where N is its share of the weight (the centre of mass is at
ground height, so braking does not shift the load). Without friction both cars are the ideal one of
the lecture, a body on one skate.

Is it stable (32 d)? Let V be the speed of the free axle, at s ahead of the centre of mass, and
omega the yaw rate; L is the wheelbase and J = I + m s^2. For small omega

    J omega' = (m s V - mu N L^2 / V) omega,    m V' = -mu N,

where the first term is due to the free axle, which leads if s > 0 and trails if s < 0, and the
second to friction, which always damps. With locked front wheels the rear wheels roll and s < 0:
omega decays, and the car is stable at any speed. With locked rear wheels s > 0, and omega grows
while V^2 > mu g L. When the speed has fallen from V0 to V, the yaw rate is

    omega = omega0 (V / V0)^(m L^2 / J) exp(m^2 s (V0^2 - V^2) / (2 mu N J)),

with locked rear wheels a growth by a factor of up to about exp(m L V0^2 / (2 mu g J)).

How does it come to rest? With u = (V, w) the velocity of the locked wheels along and across the
car, w = L omega, everything but friction is of second order in a small u:

    V' = -c V / |u|,    w' = -d w / |u|,    c = mu N / m,    d = mu N L^2 / J,

so in the variable z with dt = |u| dz both decay exponentially, and the integrals of |u|, V |u| and
w |u| over z are the remaining time and distances. Friction is reversed where u passes 0, so the
last part of a stop is not integrated: `braking` takes it from these integrals.
"""

import functools
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first, floats
from jaxdyn._numerics import safe_norm, square_norm
from jaxdyn.effects import unless_zero
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.phase import END, Exit, Phase
from jaxdyn.mechanisms.car import Car
from jaxdyn.scene import Effect, Points, Scene
from jaxdyn.scenes.ready_made import ready_made

AXLES = ("front", "rear")

# Double exponential quadrature from 0 to infinity of functions that decay at least like exp(-z).
_STEPS = np.arange(-4.0, 4.3, 1 / 16)
_Z = np.exp(_STEPS - np.exp(-_STEPS))
_WEIGHTS = _Z * (1 + np.exp(-_STEPS)) / 16


class LockedAxle(Effect):
    """Friction mu N against the velocity of the point `ahead` of a car's centre of mass.

    It acts on the coordinates (x, y, theta) of a planar body.

    Limits: it is 0 at rest, where the true force keeps the car at rest; end the motion by an event
      before that.

    Attributes:
      mu: () coefficient of friction [1].
      load: () load N of the axle [N].
      ahead: () how far the point is ahead of the centre of mass [m].
    """

    mu: Array
    load: Array
    ahead: Array
    velocity_dependent: ClassVar[bool] = True
    called: ClassVar[str] = "friction"

    def attack(self, t, q, v):
        del t, v
        return q[:2] + self.ahead * jnp.stack([jnp.cos(q[2]), jnp.sin(q[2])])

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


class _Rest(NamedTuple):
    """How a slowly sliding car comes to rest."""

    time: Array  # () duration [s]
    displacement: Array  # (2,) displacement of its centre of mass [m]
    turn: Array  # () rotation of the car [rad]


class SlideToRest(eqx.Module):
    """The end of a slide: its duration, and the final position of the car."""

    scene: Scene

    def __call__(self, t: Array, y: Array) -> Array:
        """(6,) the state at rest."""
        del t
        rest = self._rest(y)
        return jnp.concatenate([y[:2] + rest.displacement, y[2:3] + rest.turn, jnp.zeros(3)])

    def lasts(self, t: Array, y: Array) -> Array:
        """() time to rest [s]."""
        del t
        return self._rest(y).time

    def _rest(self, y: Array) -> _Rest:
        numbers, friction = _numbers(self.scene), _friction(self.scene)
        assert friction is not None  # `braking` has refused a car without friction
        e = jnp.stack([jnp.cos(y[2]), jnp.sin(y[2])])
        n = jnp.stack([-e[1], e[0]])
        along, across = jnp.sum(y[3:5] * e), numbers.base * y[5]
        pull = friction.mu * friction.load
        c, d = pull / numbers.m, pull * numbers.base**2 / numbers.j
        slower = jnp.minimum(c, d)
        u = jnp.stack([along * jnp.exp(-c / slower * _Z), across * jnp.exp(-d / slower * _Z)])
        speed = safe_norm(u.T)
        weights = _WEIGHTS / slower
        ahead, turn = jnp.sum(weights * u[0] * speed), jnp.sum(weights * u[1] * speed)
        turn = turn / numbers.base
        return _Rest(jnp.sum(weights * speed), ahead * e - numbers.s * turn * n, turn)


def sliding_velocity(ahead: Array, q: Array, v: Array) -> Array:
    """(2,) velocity of the point `ahead` on a car's centre line; 0 only if the car is at rest."""
    return v[:2] + ahead * v[2] * jnp.stack([-jnp.sin(q[2]), jnp.cos(q[2])])


@ready_made()
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
    """A car with locked front or rear wheels that moves along x (problem 32).

    Args:
      locked: "front" or "rear".
      to_front: distance from the centre of mass to the front axle [m].
      to_rear: distance from the centre of mass to the rear axle [m].
      m: mass [kg].
      inertia: moment of inertia about the centre of mass [kg m^2].
      mu: coefficient of friction of the locked wheels; exactly 0 leaves the friction out.
      g: gravity, which presses the wheels onto the ground [m/s^2].
      speed: speed of the free axle [m/s].
      spin: initial yaw rate, a disturbance [rad/s].
      t1: span [s]; it must end before the car is at rest, see `braking`.
    """
    between = "The centre of mass is between the axles."
    front = _checks.positive("to_front", to_front, between)
    rear = _checks.positive("to_rear", to_rear, between)
    _checks.choice("locked", locked, AXLES)
    body, friction, y0 = _braked(
        *floats(front, rear, m, inertia, mu, g, speed, spin), front_locked=locked == "front"
    )
    return Scene(Constrained(body), unless_zero(mu, friction), y0=y0, t1=t1)


@functools.partial(jax.jit, static_argnames="front_locked")  # one program for all of it
def _braked(to_front, to_rear, m, inertia, mu, g, speed, spin, *, front_locked: bool):
    """The body, the friction and the state of `car`."""
    front, rear = to_front, -to_rear
    slides, rolls = (front, rear) if front_locked else (rear, front)
    at, axles = jnp.stack([rolls, 0 * rolls])[None], jnp.stack([front, rear])
    body = Car(m=m, inertia=inertia, at=at, headings=jnp.zeros(1), axles=axles)
    # The load follows from the balance of moments about the other axle.
    load = m * g * jnp.abs(rolls) / (front - rear)
    v = jnp.stack([speed, -rolls * spin, spin])
    return body, LockedAxle(mu, load, slides), jnp.concatenate([jnp.zeros(3), v])


@check_first
def braking(scene: Scene) -> dict[str, Phase]:
    """The braking of a `car` down to rest, as a phase for `simulate_phases` (problem 32 b).

    ``simulate_phases(braking(scene), "slide", scene.y0, 60.0)`` ends with the car at rest. The
    locked wheels slide until the car stands: their speed is 0 only if it does not turn any more.
    The last part of the stop is in closed form, from a speed at which the neglected terms are below
    rounding.

    Args:
      scene: a `car` with friction.
    Raises:
      ValueError: the car has no friction, and never stops.
    """
    friction, numbers = _friction(scene), _numbers(scene)
    if friction is None:
        raise _checks.fail("scene", "a car with a locked axle", "none", "Give it mu > 0.")
    start = safe_norm(sliding_velocity(friction.ahead, scene.y0[:3], scene.y0[3:]))
    # The terms neglected in the last part, from the speed u on, are a share (u / whole)^2 of it,
    # and the last part is a share u / start of the whole stop.
    whole = jnp.sqrt(friction.mu * friction.load / numbers.m * jnp.abs(numbers.base))
    eps = jnp.finfo(start.dtype).eps
    slow = Slow(friction.ahead, eps * whole + jnp.cbrt(eps * start * whole**2))
    halt = SlideToRest(scene)
    return {"slide": Phase(scene, (Exit(slow, END, halt, lasts=halt.lasts),))}


@check_first
def turning_rate(scene: Scene, speed) -> Array:
    """() growth rate omega' / omega [1/s] of a small yaw rate at a speed [m/s] (problem 32 d).

    The car is unstable if it is positive. Without friction nothing damps the yaw rate.
    """
    friction, numbers = _friction(scene), _numbers(scene)
    push = numbers.m * numbers.s * speed
    if friction is None:
        return push / numbers.j
    return (push - friction.mu * friction.load * numbers.base**2 / speed) / numbers.j


def turning_left(scene: Scene, speed) -> Array:
    """() fraction [1] of a small yaw rate that is left when a car has slowed down to a speed [m/s].

    Raises:
      ValueError: the car has no friction, and does not slow down.
    """
    friction, numbers = _friction(scene), _numbers(scene)
    if friction is None:
        raise _checks.fail("scene", "a car with a locked axle", "none", "Give it mu > 0.")
    start = scene.y0[3]
    power = numbers.m * numbers.base**2 / numbers.j
    gain = numbers.m**2 * numbers.s * (start**2 - speed**2)
    grip = friction.mu * friction.load
    return (speed / start) ** power * jnp.exp(gain / (2 * grip * numbers.j))


class _Numbers(NamedTuple):
    """The mass of a car, its inertia about the free axle, and the positions of its axles."""

    m: Array
    j: Array
    s: Array  # distance of the free axle ahead of the centre of mass
    base: Array  # distance of the locked axle ahead of the free one


def _friction(scene: Scene) -> LockedAxle | None:
    return next((e for e in scene.effects if isinstance(e, LockedAxle)), None)


def _numbers(scene: Scene) -> _Numbers:
    body, friction = scene.system.mechanism, _friction(scene)
    s = body.at[0, 0]
    base = jnp.zeros(()) if friction is None else friction.ahead - s
    return _Numbers(m=body.m, j=body.inertia + body.m * s * s, s=s, base=base)
