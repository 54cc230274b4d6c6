"""Which side of an event a motion is on just after its start."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.integrate.event_search.event_values import bends, look, values

#: Roundings of state and time by which a value at a start on an event may miss zero.
_ROUNDINGS = 16
#: Part of the first step within which the first terms of its series show how the motion continues.
_CLOSE = 2.0**-10


class Beginning(NamedTuple):
    """A motion at its start, and the E events there.

    Attributes:
      t: () time.
      y: (k,) state.
      rate: (k,) its rate.
      turn: (k,) the state's second derivative.
      g: (E,) values.
      slope: (E,) slopes in time.
      noise: (E,) rounding of the values there.
      speeds: (E,) one rounding of a slope.
      bends: (E,) one rounding of a second derivative.
    """

    t: Array
    y: Array
    rate: Array
    turn: Array
    g: Array
    slope: Array
    noise: Array
    speeds: Array
    bends: Array

    @classmethod
    def of(cls, field, events: tuple, t: Array, y: Array) -> "Beginning":
        """The beginning at (t, y); `field` has ``rate(t, y)`` and a ``system``."""
        rate = field.rate(t, y)
        here = look(field, events, t, y)
        return cls(
            t=t,
            y=y,
            rate=rate,
            turn=jax.jvp(field.rate, (t, y), (jnp.ones_like(t), rate))[1],
            g=here.values,
            slope=here.slopes,
            noise=here.rounding + jnp.abs(t) * here.speeds,
            speeds=here.speeds,
            bends=bends(field, events, t, y),
        )

    def sides(self, events: tuple, h: Array, wanted: Array) -> Array:
        """(E,) signs just after the start, before a first step h ().

        If the motion starts on an event, the slope decides. Where the slope is zero as well, it
        depends on whether the value changes its sign there, as y^3 does: if so, the motion is
        leaving. If not, a crossing in the wanted direction counts: otherwise a ball that bounces by
        less than rounding would fall through the floor. If both directions are wanted, the motion
        has left.

        Args:
          events: as in `of`.
          h: () first step, negative backwards in time.
          wanted: (E,) signs after the crossings that count, 0 for both.
        """
        ahead = jnp.sign(h)
        moved = _ROUNDINGS * (self.noise + jnp.abs(h) * self.speeds + h * h * self.bends)
        moving = jnp.abs(self.slope) > _ROUNDINGS * self.speeds
        before, after = (self._near(events, s * _CLOSE * h, moved) for s in (-1.0, 1.0))
        still = jnp.where(before * after < 0, after, -wanted)
        leaving = jnp.where(moving, ahead * jnp.sign(self.slope), still)
        return jnp.where(jnp.abs(self.g) <= moved, leaving, jnp.sign(self.g))

    def _near(self, events: tuple, h: Array, noise: Array) -> Array:
        """(E,) signs a short time later, by the first terms of the series; 0 within rounding."""
        g = values(events, self.t + h, self.y + h * self.rate + 0.5 * h * h * self.turn)
        return jnp.where(jnp.abs(g) > noise, jnp.sign(g), 0.0)
