"""One particle under a central force, and its orbits: course problem 11.

11 a: v^2 / r = f(r) / m, so circular orbits of all radii have the same speed if f = k / r
(`PowerLaw` with n = -1). 11 b: a motion between two radii is always a regular rosette, never
chaotic: it repeats after each loop, rotated by twice the apsidal angle (`jaxdyn.scenes.apsidal`).
It closes if that angle is a rational multiple of pi. For nearly circular orbits under a power law
the angle is pi / sqrt(3 + n), for n > -3; only for n = 1 and n = -2 do orbits of every shape close
(Bertrand). The number of loops of the simplest closed orbit depends on n (11 b ii); it is
`fewest_loops`.
"""

import dataclasses
import math

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.effects import CentralForce, PowerLaw
from jaxdyn.formulations.extended import Extended
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Scene
from jaxdyn.scenes.apsidal import apsidal_limits
from jaxdyn.scenes.particles import particle
from jaxdyn.scenes.ready_made import ready_made


@ready_made()
def central_orbit(law: CentralForce, *, r=1.0, speed=0.6, m=1.0, t1=20.0) -> Scene:
    """A particle under any central force, started across the x axis (problem 11).

    Args:
      law: the force.
      r: initial distance, on the x axis [m].
      speed: initial speed, along y [m/s].
      m: mass [kg].
      t1: span [s].
    """
    position, velocity = (jnp.stack(jnp.broadcast_arrays(*x)) for x in ((r, 0.0), (0.0, speed)))
    return particle(law, position=position, velocity=velocity, m=m, t1=t1)


@ready_made()
def power_law(*, k=1.0, n=-1.0, r=1.0, speed=0.6, m=1.0, t1=20.0) -> Scene:
    """A particle under the attraction k r^n, started across the x axis (problem 11).

    Args:
      k: strength [N/m^n].
      n: exponent [1]; -2 is gravity, 1 a spring, -1 the law of 11 a.
      r: initial distance, on the x axis [m].
      speed: initial speed, along y [m/s].
      m: mass [kg].
      t1: span [s].
    """
    return central_orbit(PowerLaw(k, n), r=r, speed=speed, m=m, t1=t1)


def circular_speed(law: CentralForce, r, m=1.0) -> Array:
    """() speed [m/s] of the circular orbit of radius r: sqrt(r f(r) / m); NaN for a repulsion."""
    r = jnp.asarray(r, dtype=float)
    return jnp.sqrt(r * law.attraction(r) / m)


@check_first
def swept_angle(scene: Scene, t1=None, *, rtol: float = 1e-12) -> Array:
    """() angle [rad] by which a point in the plane turns about the origin, full turns included.

    The angle is integrated with the motion, as a further entry of the state, since samples of the
    motion can miss a turn close to the centre, while steps cannot.

    Args:
      scene: one point in the plane with its effects.
      t1: () end time [s]; the scene's own span by default.
      rtol: tolerance of the integration.
    Returns:
      The angle, positive from x to y; NaN where the motion does not reach t1.
    Example:
      >>> round(float(swept_angle(power_law(n=-2.0, speed=0.01, t1=3.0))), 9)
      6.293409842
    """
    y0 = jnp.append(_checks.array("y0", scene.y0, (4,), "One point in the plane."), 0.0)
    swept = dataclasses.replace(scene, system=_SweptAngle(scene.system), y0=y0)
    return solve(swept, scene.t1 if t1 is None else t1, rtol=rtol).y1[-1]


class _SweptAngle(Extended):
    """A point in the plane with the angle by which it has turned about the origin."""

    def further(self):
        return (("angle", "rad"),)

    def rate(self, t, y, effects):
        x1, x2, v1, v2 = y[:-1]
        turning = (x1 * v2 - x2 * v1) / (x1 * x1 + x2 * x2)
        return jnp.append(self.system.rate(t, y[:-1], effects), turning)


def fewest_loops(n: float) -> int:
    """The least number of loops of a closed orbit other than a circle, for the attraction k r^n.

    From circles to straight lines the apsidal angle over pi goes from 1 / sqrt(3 + n) to 1 / 2, or
    to 1 / (3 + n) for n < -1, and takes every value between. An orbit with the value p / q, in
    lowest terms, closes with q loops; the result is the least q (11 b ii): 1 for gravity, 2 for a
    spring, 3 for n = -1, and ever more as n approaches 1 or -2, but not at these.

    Args:
      n: exponent, > -3; below that no orbit exists between two radii.
    Raises:
      ValueError: `n` is not above -3.
    Limits: see `apsidal_limits`.
    """
    if not n > -3:
        raise _checks.fail("n", "above -3", n, "Steeper laws have no orbits between two radii.")
    circle, line = map(float, apsidal_limits(n))
    if circle == line:  # it is the same for all orbits: exactly 1/2 for a spring, 1 for gravity
        return round(1 / circle)
    low, high = sorted((circle, line))
    loops = 1
    while not math.floor(loops * low) + 1 < loops * high:
        loops += 1
    return loops
