"""One particle under a central force, and its orbits: course problem 11.

11 a: v^2 / r = f(r) / m, so circular orbits of all radii have one speed if f = k / r
(`PowerLaw` with n = -1). 11 b: a motion between two radii always makes a regular rosette, never
a chaotic one: it repeats after each loop, turned by twice the `apsidal_angle`. It closes if that
angle is a rational part of pi. For nearly circular orbits under a power law it is
pi / sqrt(3 + n), for n > -3; only n = 1 and n = -2 close at every radius (Bertrand). How many
loops the simplest closed orbit has depends on n (11 b ii): `fewest_loops`.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._arguments import like_defaults
from jaxdyn._floats import floats
from jaxdyn.effects import CentralForce, PowerLaw
from jaxdyn.scene import Scene
from jaxdyn.scenes.particles import particle

_NODES = 64
_ANGLES = (np.arange(_NODES) + 0.5) * np.pi / _NODES


@like_defaults()
def central_orbit(law: CentralForce, *, r=1.0, speed=0.6, m=1.0, t1=20.0) -> Scene:
    """A particle under any central force, started across the x axis (problem 11).

    Args:
      law: the force.
      r: start on the x axis [m].
      speed: start along y [m/s].
      m: mass [kg].
      t1: span [s].
    """
    position, velocity = (jnp.stack(jnp.broadcast_arrays(*x)) for x in ((r, 0.0), (0.0, speed)))
    return particle(law, position=position, velocity=velocity, m=m, t1=t1)


@like_defaults()
def power_law(*, k=1.0, n=-1.0, r=1.0, speed=0.6, m=1.0, t1=20.0) -> Scene:
    """A particle under the attraction k r^n, started across the x axis (problem 11).

    Args:
      k: strength [N/m^n].
      n: exponent [1]; -2 is gravity, 1 a spring, -1 the law of 11 a.
      r: start on the x axis [m].
      speed: start along y [m/s].
      m: mass [kg].
      t1: span [s].
    """
    return central_orbit(PowerLaw(k, n), r=r, speed=speed, m=m, t1=t1)


def circular_speed(law: CentralForce, r, m=1.0) -> Array:
    """() [m/s] speed of the circular orbit of radius r: sqrt(r f(r) / m); NaN if repelled."""
    r = jnp.asarray(r, dtype=float)
    return jnp.sqrt(r * law.attraction(r) / m)


def apsidal_angle(law: CentralForce, r_min, r_max) -> Array:
    """() [rad] angle about the centre from the nearest to the farthest point of an orbit.

    The integral of dtheta/dr from r_min to r_max in u = 1/r, by Gauss-Chebyshev quadrature
    with 64 nodes, whose weight takes the square-root ends. The mass plays no part. An orbit
    with angle pi p / q, in lowest terms, closes after p turns with q loops.

    Args:
      law: the force; its energy is what enters.
      r_min: smallest distance [m].
      r_max: largest distance [m], > r_min.
    Returns:
      The angle; pi / 2 for a spring, pi for gravity, about pi / sqrt(3 + n) near a circle.
      NaN where no orbit moves between these radii.
    Limits: towards the circle its error grows like 1e-13 / (1 - r_min/r_max)^2, by
      cancellation; for smooth laws it is right to 1e-11 down to ratios of about 0.05.
    Example:
      >>> from jaxdyn.effects import PowerLaw
      >>> print(round(float(apsidal_angle(PowerLaw(1.0, -2.0), 0.5, 1.0)), 12))
      3.14159265359
    """
    r_min, r_max = floats(r_min, r_max)
    if not _checks.is_traced((r_min, r_max)) and not bool((0 < r_min) & (r_min < r_max)):
        raise _checks.fail("r_max", f"above r_min = {r_min} > 0", r_max, "They are distances.")
    low, high = 1 / r_max, 1 / r_min

    def energy(u):
        return law.energy(1 / u)

    # From energy and angular momentum at the two ends: L^2 / (2 m), and (du/dtheta)^2.
    l2 = (energy(low) - energy(high)) / (high * high - low * low)
    u = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(_ANGLES)
    slope2 = (energy(low) - jax.vmap(energy)(u)) / l2 + low * low - u * u
    # Without this a repulsion, where l2 < 0, would give the angle of the attraction.
    slope2 = jnp.where(l2 > 0, slope2, jnp.nan)
    return jnp.mean(jnp.sqrt((high - u) * (u - low) / slope2)) * jnp.pi


def fewest_loops(n: float) -> int:
    """The least number of loops of a closed orbit, not a circle, under the attraction k r^n.

    From circles to straight lines the apsidal angle over pi goes from 1 / sqrt(3 + n) to 1 / 2, or
    to 1 / (3 + n) for n < -1, and takes each value between. An orbit with p / q there, in lowest
    terms, closes with q loops, so the least q is asked for (11 b ii): 1 for gravity, 2 for a
    spring, 3 for n = -1, and more and more as n comes near to 1 or -2, but for these themselves.

    Args:
      n: exponent, > -3; below no orbit moves between two radii.
    Raises:
      ValueError: no such exponent.
    Limits: that the angle goes evenly from one end to the other is known by computation.
    """
    if not n > -3:
        raise _checks.fail("n", "above -3", n, "Steeper laws have no orbits between two radii.")
    circle, line = 1 / math.sqrt(3 + n), (0.5 if n >= -1 else 1 / (3 + n))
    if circle == line:  # one angle for all: exactly 1/2 for a spring, 1 for gravity
        return round(1 / circle)
    low, high = sorted((circle, line))
    loops = 1
    while not math.floor(loops * low) + 1 < loops * high:
        loops += 1
    return loops
