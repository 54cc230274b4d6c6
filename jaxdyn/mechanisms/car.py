"""A car seen from above, one axle of which rolls: course problem 32."""

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.mechanisms.skates import Skated
from jaxdyn.sketch import Shape, frame, rectangle, traces


class Car(Skated):
    """A planar body with two axles, whose skate is the axle that rolls.

    The two wheels of an axle act as one on the centre line.

    Attributes:
      axles: (2,) positions of the front and rear axle along the body's x axis [m], for drawings
        only.
    """

    axles: Array

    def bodies(self, t, q):
        return tuple(part._replace(name="car") for part in super().bodies(t, q))

    def joints(self, t, q):
        return tuple(wheel._replace(name="rolling axle") for wheel in super().joints(t, q))

    def sketch(self, t, q):
        del t
        turn = frame(jnp.stack([jnp.cos(q[2]), jnp.sin(q[2])]))
        return tuple(shape.place(q[:2], turn) for shape in _from_above(self.axles))


def _from_above(axles: Array) -> tuple[Shape, ...]:
    """The shapes of a car in its own axes, with its axles at positions (2,) along x."""
    base = axles[0] - axles[1]
    track, across = 0.55 * base, jnp.zeros(())
    middles = jnp.stack([axles, jnp.stack([across, across])], axis=1)
    body = rectangle("area", (1.5 * base, 0.65 * base), jnp.mean(middles, axis=0))
    wheels = [
        rectangle(
            "solid", (0.25 * base, 0.08 * base), middle + jnp.stack([across, side * track / 2])
        )
        for middle in middles
        for side in (1.0, -1.0)
    ]
    return body, *wheels, *traces(middles, ["front axle", "rear axle"])
