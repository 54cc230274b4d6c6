"""One particle, in cartesian and polar coordinates: course problems 1, 8, 9, 12 and 27."""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._checks import check_first, floats
from jaxdyn.effects import LinearDrag, QuadraticDrag, UniformGravity, unless_zero
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.formulations.polar import PolarParticle, polar_basis, polar_state
from jaxdyn.integrate.trajectory import Trajectory, each_motion
from jaxdyn.scene import Effect, Scene
from jaxdyn.scenes.ready_made import ready_made


@ready_made("position", "velocity")
def particle(*effects: Effect, position=(0.0, 0.0), velocity=(1.0, 1.0), m=1.0, t1=1.0) -> Scene:
    """One particle with any forces in the plane or in space (problem 1).

    Args:
      effects: effects that act on it; none by default.
      position: (d,) initial position [m]; its length sets the dimension.
      velocity: (d,) initial velocity [m/s].
      m: mass [kg].
      t1: span [s].
    """
    position, velocity = floats(position, velocity)
    y0 = jnp.concatenate([position, velocity])
    return Scene(FreePoints(m, d=len(position)), effects, y0=y0, t1=t1)


@ready_made()
def cannonball(
    *, speed=10.0, angle=math.pi / 4, m=1.0, g=9.81, drag=0.0, linear=0.0, t1=1.0
) -> Scene:
    """A ball thrown from the origin, x to the right and y up (problems 9, 12, 27).

    Problem 12 gives no drag coefficient: take 1 kg/m, and try others. Problem 27 calls
    itself a continuation of problem 10, but it continues 12, with c = 0.5 kg/m. The solution in
    closed form for linear drag is in `jaxdyn.scenes.ballistics`.

    Args:
      speed: launch speed [m/s].
      angle: launch angle above the horizontal [rad].
      m: mass [kg].
      g: gravity [m/s^2].
      drag: coefficient c of the drag c |v| v [kg/m]; exactly 0 leaves the effect out.
      linear: coefficient c of the drag c v [kg/s]; exactly 0 leaves the effect out.
      t1: span [s].
    """
    effects = unless_zero(g, UniformGravity(g))
    effects += unless_zero(drag, QuadraticDrag(drag)) + unless_zero(linear, LinearDrag(linear))
    return particle(*effects, velocity=_launch(speed, angle), m=m, t1=t1)


@jax.jit  # one program, not one for each operation
def _launch(speed, angle) -> Array:
    return speed * jnp.stack([jnp.cos(angle), jnp.sin(angle)])


@ready_made()
def polar_particle(
    *effects: Effect, position=(1.0, 0.5), velocity=(-1.0, 0.0), m=1.0, t1=2.0
) -> Scene:
    """A free particle whose straight path is found in polar coordinates (problem 8).

    Args:
      effects: effects that act on it; none in the problem.
      position: (2,) initial x, y [m]; not the origin.
      velocity: (2,) initial velocity [m/s]; by default the path passes the origin at 0.5 m.
      m: mass [kg].
      t1: span [s].
    """
    y0 = polar_state(*floats(position, velocity))
    return Scene(PolarParticle(m), effects, y0=y0, t1=t1)


@check_first
@each_motion
def straightness(motion: Trajectory) -> Array:
    """() deviation [1] of the path of the first point from a straight line; 0 for a straight one.

    It is the largest distance of the samples from the straight line that fits them best, over the
    largest distance between two of them along that line (problem 8 d). It says nothing about the
    speed.

    Limits: planar motions; not differentiable for an exactly straight path.
    """
    r = motion.r[:, 0]
    x, y = (r - jnp.mean(r, axis=0, keepdims=True)).T
    lean = 0.5 * jnp.arctan2(2 * jnp.sum(x * y), jnp.sum(x * x - y * y))
    along, across = polar_basis(lean)
    s = x * along[0] + y * along[1]
    off = x * across[0] + y * across[1]
    return jnp.max(jnp.abs(off)) / (jnp.max(s) - jnp.min(s))
