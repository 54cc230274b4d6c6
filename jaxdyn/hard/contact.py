"""Motions with corners: infinitely many bounces in finite time, and sliding to rest.

Compared with closed forms: the times of the bounces are a geometric series, and a car that brakes
straight slows down evenly.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.events import Reaches
from jaxdyn.hard.case import Case, Figure, relative_error
from jaxdyn.phases import END, Exit, Phase, run
from jaxdyn.scenes.particles import cannonball
from jaxdyn.scenes.wheels import braking, car

_G = 10.0
_UP = 5.0  # [m/s]
_SLOW = 1e-8  # [m/s] below which a ball does not bounce any more


class Bounce(eqx.Module):
    """The vertical speed turns round, a part of it is kept."""

    keeps: Array

    def __call__(self, t: Array, y: Array) -> Array:
        """The state (4,) after the bounce."""
        del t
        return y.at[3].multiply(-self.keeps)


class Tired(eqx.Module):
    """Whether a ball stays on the floor: 1 for END."""

    speed: Array

    def __call__(self, t: Array, y: Array) -> Array:
        """The number of the next phase."""
        del t
        return jnp.where(y[3] < self.speed, 1, 0)


def bouncing(keeps: float) -> dict[str, Phase]:
    """A ball that keeps a part of its speed at each bounce, and stays down in the end."""
    lands = Reaches(1, 0.0, -1)
    rest = Tired(jnp.asarray(_SLOW))
    landing = Exit(lands, ("fly", END), Bounce(jnp.asarray(keeps)), rest)
    return {"fly": Phase(cannonball(g=_G), (landing,))}


def _bounces() -> tuple[Figure, ...]:
    keeps = 0.8
    chain = run(bouncing(keeps), "fly", [0.0, 0.0, 1.0, _UP], 1e3, samples=2)
    flights = 2 * _UP / _G * keeps ** np.arange(len(chain.times))
    zeno = 2 * _UP / _G / (1 - keeps)
    return (
        Figure("times of the bounces", relative_error(chain.times, np.cumsum(flights)), 1e-10),
        Figure("end of infinitely many bounces", relative_error(chain.t, zeno), 1e-8),
        Figure("phases", len(chain.names), 100),
        Figure("no clear end", float(not chain.ended), 0),
        Figure("deepest under the floor [m]", float(max(-p.ys[:, 1].min() for p in chain.pieces))),
    )


def _brake() -> tuple[Figure, ...]:
    speed, mu, g = 20.0, 0.7, 9.81
    scene = car(locked="rear", spin=0.0, mu=mu, g=g, speed=speed)
    chain = run(braking(scene), "slide", scene.y0, 60.0, samples=2)
    slows = mu * g * 1.2 / 2.6  # the part of the weight on the rear axle
    # The end is taken at a millionth of the speed; a millionth of the time is left out.
    left = 1 - 1e-6
    return (
        Figure("time of the stop", relative_error(chain.t, left * speed / slows), 1e-10),
        Figure("way of the stop", relative_error(chain.y[0], speed**2 / (2 * slows)), 1e-10),
        Figure("speed after it [m/s]", float(jnp.max(jnp.abs(chain.y[3:]))), 0),
        Figure("phases", len(chain.names), 1),
    )


CASES = (
    Case("zeno", "A ball bounces infinitely often in finite time, and comes to rest.", _bounces),
    Case("braking-to-rest", "A car slides until it stands, and stays there.", _brake),
)
