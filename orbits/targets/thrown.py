"""A thrown point in axes along its launch, in units that preserve its digits.

Each number is in units of its size when the throw lands, even if that is 1e-20 of its size at the
launch. So a fast ball that drag stops and a throw along the ground keep their digits, also in their
derivatives.
"""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import System
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate import events


class Units(eqx.Module):
    """The units of a throw, along its launch and across.

    A force that is given by its x and y components has rounding errors in every direction that are
    a fraction of the speed, and so have its derivatives: until drag has reduced the speed, speeds
    below that rounding are not significant.
    """

    lengths: Array  # (2,) [m]
    last: Array  # (2,) speeds on landing [m/s]
    grain: Array  # () unit at the launch: rounding of the speed over the tolerance [m/s]
    memory: Array  # () relaxation time of the speed [s]
    time: Array  # () [s]; flights of 1e100 s are no harder than those of a second

    def speeds(self, t: Array) -> Array:
        """(2,) units of speed [m/s] at a time () in units."""
        return self.last + self._fading(t)

    def speeds_rate(self, t: Array) -> Array:
        """() rate of change of those units [m/s^2]."""
        return -self._fading(t) / (2 * self.memory)

    def _fading(self, t: Array) -> Array:
        return self.grain * jnp.exp(-t * self.time / (2 * self.memory))


class ThrownSystem(System):
    """A point in axes along its launch, with the state a, b, va, vb: forwards and to the left.

    State and time are in `Units`.
    """

    system: FreePoints
    origin: Array
    #: Not the angle, so that tangents of flat throws are as small as they should be; nor its cosine
    #: and sine, whose tangents cancel in each rate: at 1e12 m/s they take 80 times more steps.
    course: Array
    units: Units

    @property
    def accepts(self):
        return self.system.accepts

    def labels(self):
        return ("a", "1"), ("b", "1"), ("va", "1"), ("vb", "1")

    def state(self, t: Array, z: Array) -> Array:
        """(4,) state of the point itself."""
        r, v = self.position_and_velocity(t, z)
        c, s = direction(self.course)
        return jnp.concatenate([rotate(r, c, s) + self.origin, rotate(v, c, s)])

    def position_and_velocity(self, t: Array, z: Array) -> tuple[Array, Array]:
        """(2,) displacement and (2,) velocity, both with entries along the launch and across."""
        r, v = z.reshape(2, 2)
        return r * self.units.lengths, v * self.units.speeds(t)

    def points(self, t, y):
        return self.system.points(t, self.state(t, y))

    @functools.partial(jax.jit, inline=True)  # traced once for its many uses in a throw
    def rate(self, t, y, effects):
        c, s = direction(self.course)
        unit, state = self.units.time, self.state(t, y)
        acceleration = rotate(self.system.rate(t * unit, state, effects)[2:], c, -s)
        speeds = self.units.speeds(t)
        gain = (acceleration - y[2:] * self.units.speeds_rate(t)) / speeds
        return unit * jnp.concatenate([y[2:] * speeds / self.units.lengths, gain])


@functools.partial(jax.jit, inline=True)  # traced once for all its uses
def direction(w: Array) -> tuple[Array, Array]:
    """Cosine and sine of the launch angle of a course.

    They are not computed by tanh or expm1, whose derivatives in JAX cancel for flat throws.
    """
    forwards = w < 0
    h = jnp.exp(jnp.where(forwards, w, -w))
    cosine = (1 - h * h) / (1 + h * h)
    return jnp.where(forwards, cosine, -cosine), 2 * h / (1 + h * h)


def rotate(vector: Array, c: Array, s: Array) -> Array:
    """(2,) the vector rotated by the angle with this cosine and sine."""
    return jnp.stack([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


class Down(events.Event):
    """The event that the point falls to the ground, which lies below the launch."""

    course: Array
    lengths: Array
    height: Array  # () of the launch above the ground [m]

    def value(self, t, y):
        del t
        forward, across = self.lengths / self.lengths[1]
        c, s = direction(self.course)
        return s * forward * y[0] + c * across * y[1] + self.height / self.lengths[1]

    @property
    def direction(self):
        return -1
