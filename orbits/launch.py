"""One throw: where it comes down, and how that changes with its angle and its speed.

The scene is seen in a frame turned by the launch angle, in lengths and speeds of the throw's own
size: all throws then start from the same numbers, and the angle and the speed are numbers of the
field. Speeds are measured by one that falls as the drag slows the ball down, so 1e8 m/s costs
little more than 10 m/s, and keeps its digits.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status, System, events
from jaxdyn._checks import fail
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import checked

RTOL = 1e-13
_PATIENCE = 100.0  # times v / g: flights longer than this count as endless
_STEPS = 20_000  # at most; a flight that needs more is stiff
_CHUNK = 64  # throws a call of the compiled program; fewer are filled up


class Landings(eqx.Module):
    """Where throws come down; one entry a throw, NaN where it does not.

    Attributes:
      x: (n,) distance from the launch along the first axis, at launch height [m].
      t: (n,) time of flight [s].
      dx: (n, 2) derivatives of x in the course w = log tan(angle / 2) and in log(speed) [m].
      vx: (n,) velocity on landing [m/s].
      vy: (n,) velocity on landing [m/s].
      status: (n,) `jaxdyn.Status` codes of the integration.
    """

    x: np.ndarray
    t: np.ndarray
    dx: np.ndarray
    vx: np.ndarray
    vy: np.ndarray
    status: np.ndarray


def landings(scene: Scene, w, speed, rtol: float = RTOL) -> Landings:
    """Where throws of so many courses and speeds land.

    Args:
      scene: see `checked_throw`.
      w: (n,) courses log tan(angle / 2): -inf along the first axis, 0 straight up.
      speed: (n,) launch speeds [m/s], > 0.
      rtol: tolerance of the integrations.
    """
    w, log_speed = (np.array(x, float).ravel() for x in np.broadcast_arrays(w, np.log(speed)))
    parts = []
    for i in range(0, len(w), _CHUNK):
        # One shape for any number of throws: one compilation.
        rows = np.minimum(np.arange(i, i + _CHUNK), len(w) - 1)
        part = _compiled(scene, w[rows], log_speed[rows], np.asarray(rtol))
        parts.append(jax.tree.map(lambda x: np.asarray(x), part))
    return jax.tree.map(lambda *parts: np.concatenate(parts)[: len(w)], *parts)


def checked_throw(scene: Scene) -> Scene:
    """The scene, if it is a single point in the plane that something pulls back.

    Raises:
      ValueError: another kind of scene.
    """
    scene = checked(scene)
    system = scene.system
    if not (isinstance(system, FreePoints) and system.d == 2 and len(system.m) == 1):
        raise fail(
            "scene",
            "one point that is thrown in the plane",
            type(system).__name__,
            "scenes.cannonball() and scenes.particle(...) are such.",
        )
    if not float(_pull(scene)) > 0:
        raise fail("scene", "a force on the point at rest", "none", "Add UniformGravity(9.81).")
    return scene


def angle_of(w):
    """Launch angle [rad] of a course."""
    return 2 * jnp.arctan(jnp.exp(w)) if isinstance(w, Array) else 2 * np.arctan(np.exp(w))


def launched(scene: Scene, angle: float, speed: float, t1: float) -> Scene:
    """The scene with its point thrown at an angle [rad] with a speed [m/s], over a span [s]."""
    velocity = speed * np.array([np.cos(angle), np.sin(angle)])
    return scene.starting(np.concatenate([np.asarray(scene.y0)[:2], velocity]), t1)


class _Thrown(System):
    """A point seen along its launch: state a, b, va, vb, forwards and to the left, all pure."""

    system: FreePoints
    origin: Array
    angle: Array
    speed: Array
    units: tuple[Array, Array, Array]  # length; decay [1/s] and last share of the speed's unit

    @property
    def obeys(self):
        return self.system.obeys

    def labels(self):
        return ("a", "1"), ("b", "1"), ("va", "1"), ("vb", "1")

    def pace(self, t: Array) -> Array:
        """The unit of speed as a share of the launch speed."""
        _, decay, last = self.units
        return last + (1 - last) / (1 + decay * t)

    def state(self, t: Array, z: Array) -> Array:
        """(4,) state of the point itself."""
        return self.moved(t, z) + jnp.concatenate([self.origin, jnp.zeros(2)])

    def moved(self, t: Array, z: Array) -> Array:
        """(4,) the way it has come, and its velocity: short throws far from zero keep digits."""
        unit = jnp.stack([self.units[0], self.speed * self.pace(t)])[:, None]
        c, s = jnp.cos(self.angle), jnp.sin(self.angle)
        forward, left = z.reshape(2, 2).T
        turned = unit * jnp.stack([c * forward - s * left, s * forward + c * left], axis=1)
        return turned.ravel()

    def points(self, t, y):
        return self.system.points(t, self.state(t, y))

    def rate(self, t, y, effects):
        length, decay, last = self.units
        pace = self.pace(t)
        unit = self.speed * pace
        fading = (1 - last) * decay / (pace * (1 + decay * t) ** 2)
        ax, ay = self.system.rate(t, self.state(t, y), effects)[2:] / unit
        c, s = jnp.cos(self.angle), jnp.sin(self.angle)
        along, across = c * ax + s * ay, c * ay - s * ax
        gain = jnp.stack([along, across]) + fading * y[2:]
        return jnp.concatenate([unit / length * y[2:], gain])


class _Down(events.Event):
    """Height over the launch falls to zero."""

    angle: Array

    def value(self, t, y):
        del t
        return jnp.sin(self.angle) * y[0] + jnp.cos(self.angle) * y[1]

    @property
    def direction(self):
        return -1


def _pull(scene: Scene, velocity=(0.0, 0.0)) -> Array:
    """() size of the acceleration at the launch [m/s^2]."""
    y = jnp.concatenate([scene.y0[:2], jnp.asarray(velocity, float)])
    return jnp.linalg.norm(scene.rate(jnp.zeros(()), y)[2:])


def _landing(scene: Scene, w: Array, log_speed: Array, rtol: Array):
    angle, speed = angle_of(w), jnp.exp(log_speed)
    g = _pull(scene)
    slowing = _pull(scene, speed * jnp.stack([jnp.cos(angle), jnp.sin(angle)]))
    # The path on which the first force would use up the speed, and the speed that a fall gives.
    length = speed * speed / jnp.maximum(slowing, g)
    last = jnp.minimum(jnp.sqrt(g * length) / speed, 1.0)
    units = jax.lax.stop_gradient((length, speed / length, last))
    system = _Thrown(scene.system, scene.y0[:2], angle, speed, units)
    throw = Scene(system, scene.effects, y0=jnp.array([0.0, 0.0, 1.0, 0.0]))
    longest = jax.lax.stop_gradient(_PATIENCE * speed / g)
    down = _Down(angle)
    stop = events.until(throw, down, longest, rtol=rtol, atol=rtol, max_steps=_STEPS)
    end = system.moved(stop.t, stop.y)
    happened = stop.event >= 0
    x = jnp.where(happened, end[0], jnp.nan)
    return x, (jnp.where(happened, stop.t, jnp.nan), end[2], end[3], stop.status)


@jax.jit
def _compiled(scene: Scene, w: Array, log_speed: Array, rtol: Array) -> Landings:
    def one(throw):
        def x(p):
            value, rest = _landing(scene, p[0], p[1], rtol)
            return value, (value, *rest)

        dx, (value, t, vx, vy, status) = jax.jacfwd(x, has_aux=True)(jnp.stack(throw))
        return Landings(value, t, dx, vx, vy, status)

    # One after the other: each takes its own steps, in one folded loop.
    return jax.lax.map(one, (w, log_speed))


def followed(found: Landings) -> np.ndarray:
    """(n,) whether each throw could be followed, be it to the ground or for ever."""
    return found.status == Status.OK
