"""The end of a throw dominated by drag: a steady fall, in a straight line.

A solver's steps would be limited by the relaxation time, of which such a fall may last a billion.
If the force does not depend on place and time, the steady fall is uniform: it is not integrated.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from orbits.targets.thrown import direction, rotate

_NEWTONS = 400  # Newton steps to the steady velocity: each at least halves the distance
_FORGOTTEN = 45.0  # relaxation times in which a steady velocity is reached: e^-45 of the launch
_ROUNDED = 6.0  # beyond twice those to the steady speed: rounding of the launch speed is forgotten
_STEADY = 1e-5  # of the speed: the squares of smaller deviations are rounding
_SAME_FORCE = 1e-12  # of the acceleration, where forces are compared
#: Parts of a steady fall at which its force is sampled.
_ON_THE_WAY = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 12), np.arange(1, 16) / 16])
#: Places in units of the throw's length, and times in units of the time it takes at full speed.
_ELSEWHERE = (((1.0, 0.3), 0.0), ((0.01, 0.7), 0.0), ((-0.4, -0.1), 0.0), ((0.0, 0.0), 1.3))


class Fall(NamedTuple):
    """Relaxation of a throw to a steady fall.

    Attributes:
      memory: () relaxation time of its steady velocity [s]; infinite if it has none.
      settled: () time after which it falls steadily, to rounding [s]; infinite if the force depends
        on place or time.
    """

    memory: Array
    settled: Array


def fall_of(scene: Scene, launch: Array, length: Array) -> Fall:
    """How the throw with this launch velocity (2,) [m/s] and this size () [m] relaxes."""
    down, speed = acceleration(scene, jnp.zeros(2)), jnp.linalg.norm(launch)
    g = jnp.linalg.norm(down)

    def newton(_, v):
        return v - _solve(_slope(scene, v), acceleration(scene, v))

    # From large speeds Newton's method always converges: drag grows with the speed.
    steady = jax.lax.fori_loop(0, _NEWTONS, newton, launch + speed * down / g)
    (a, b), (_, d) = slope = _slope(scene, steady)
    slowest = -0.5 * (a + d) - jnp.hypot(0.5 * (a - d), b)  # the smaller rate of the two
    known = (jnp.abs(acceleration(scene, steady)) <= _STEADY * g).all() & (slowest > 0)
    known = known & jnp.isfinite(slope).all()
    memory = jnp.where(known, 1 / jnp.where(known, slowest, 1.0), jnp.inf)
    excess = jnp.log1p(speed / (g * memory))
    # Its rounding is kept in units that fade half as fast (`thrown.Units`).
    settled = memory * (excess + jnp.maximum(excess + _ROUNDED, _FORGOTTEN))
    return Fall(memory, jnp.where(_is_uniform(scene, launch, length), settled, jnp.inf))


class End(NamedTuple):
    """Where a steady fall ends, along the launch and across it.

    Attributes:
      t: () time [s]; NaN, like all others, if it does not land.
      r: (2,) displacement from the launch [m].
      v: (2,) velocity [m/s].
      lost: () whether the fall is not steady, so that its end is unknown.
    """

    t: Array
    r: Array
    v: Array
    lost: Array


def fallen(scene: Scene, w: Array, t: Array, r: Array, v: Array) -> End:
    """The end of the steady fall reached by a throw of course w at r (2,) with v (2,)."""
    c, s = direction(w)

    def gain(v, r=r, t=t):
        return rotate(acceleration(scene, rotate(v, c, s), rotate(r, c, s), t), c, -s)

    slope = jax.jacfwd(gain)(v)
    off = _solve(slope, gain(v))
    steady = v - off
    # The remaining deviation of velocity displaces it by its integral of exp(slope t).
    r = r - _solve(slope, off)
    up = jnp.stack([s, c])
    sinking = -jnp.sum(up * steady)
    comes = sinking > 0
    left = jnp.sum(up * r) / jnp.where(comes, sinking, 1.0)
    on_the_way = jax.vmap(lambda part: gain(steady, r + part * left * steady, t + part * left))
    gains = on_the_way(jnp.asarray(_ON_THE_WAY))
    size = _STEADY * jnp.linalg.norm(steady)
    lost = ~(jnp.linalg.norm(off) <= size)
    lost = lost | ~(jnp.abs(gains).max() <= _STEADY * jnp.linalg.norm(slope @ steady))
    left = jnp.where(comes & ~lost, left, jnp.nan)
    return End(t=t + left, r=r + steady * left, v=steady + 0.0 * left, lost=lost)


def acceleration(scene: Scene, velocity: Array, place=0.0, t=0.0) -> Array:
    """(2,) acceleration of the point with a velocity, at a place relative to its launch [m/s^2]."""
    y = jnp.concatenate([scene.y0[:2] + place, velocity])
    return scene.rate(jnp.asarray(t, float), y)[2:]


def _slope(scene: Scene, velocity: Array) -> Array:
    return jax.jacfwd(lambda v: acceleration(scene, v))(velocity)


def _solve(matrix: Array, right: Array) -> Array:
    """(2,) solution of two linear equations."""
    (a, b), (c, d) = matrix
    return jnp.stack([d * right[0] - b * right[1], a * right[1] - c * right[0]]) / (a * d - b * c)


def _is_uniform(scene: Scene, velocity: Array, length: Array) -> Array:
    """() whether the force at sample places and times equals that at the launch."""
    here = acceleration(scene, velocity)
    time = length / jnp.linalg.norm(velocity)
    gaps = [
        jnp.abs(acceleration(scene, velocity, length * jnp.array(place), time * moment) - here)
        for place, moment in _ELSEWHERE
    ]
    return jnp.max(jnp.stack(gaps)) <= _SAME_FORCE * jnp.linalg.norm(here)
