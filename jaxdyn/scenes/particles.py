"""One particle: thrown, free, in cartesian and polar coordinates; course problems 1, 8, 9, 12, 27.

Also the Lorenz system of problem 3, which has no particle at all.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._floats import as_float, floats
from jaxdyn.effects import LinearDrag, QuadraticDrag, UniformGravity, unless_zero
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.trajectory import Trajectory, each_motion
from jaxdyn.scene import Effect, Points, Scene, System
from jaxdyn.scenes.ready_made import ready_made


@ready_made("position", "velocity")
def particle(*effects: Effect, position=(0.0, 0.0), velocity=(1.0, 1.0), m=1.0, t1=1.0) -> Scene:
    """One particle with any forces in the plane or in space (problem 1).

    Args:
      effects: what acts on it, nothing if left out.
      position: (d,) start [m]; its length sets the dimension.
      velocity: (d,) start [m/s].
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

    Problem 12 gives no drag coefficient: take 1 kg/m, and look at others. Problem 27 calls
    itself a continuation of problem 10; it continues 12, with c = 0.5 kg/m. What is known in
    closed form with linear drag is in `jaxdyn.scenes.ballistics`.

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
    velocity = (speed * jnp.cos(angle), speed * jnp.sin(angle))
    return particle(*effects, velocity=jnp.stack(velocity), m=m, t1=t1)


class PolarParticle(System):
    """A particle of mass m [kg] in the plane, in polar coordinates: state r, theta, vr, omega.

    r'' = r theta'^2 + F_r / m,  theta'' = (F_theta / m - 2 r' theta') / r

    Limits: r = 0 is a singularity of the coordinates, not of the motion: a path through the
    origin itself has no omega there (NaN), one that passes near it has a short fast turn.
    """

    m: Array = eqx.field(converter=as_float, default=1.0)

    @property
    def accepts(self):
        return frozenset({"force"})

    def labels(self):
        return ("r", "m"), ("theta", "rad"), ("vr", "m/s"), ("omega", "rad/s")

    def points(self, t, y):
        del t
        r, theta, vr, omega = y
        e_r, e_theta = _polar_basis(theta)
        position = (r * e_r)[None, :]
        return Points(position, (vr * e_r + r * omega * e_theta)[None, :], self.m[None])

    def rate(self, t, y, effects):
        r, theta, vr, omega = y
        points = self.points(t, y)
        force = sum((e.force(t, *points)[0] for e in effects), jnp.zeros(2))
        e_r, e_theta = _polar_basis(theta)
        a_r = jnp.sum(force * e_r) / self.m + r * omega * omega
        a_theta = (jnp.sum(force * e_theta) / self.m - 2 * vr * omega) / r
        return jnp.stack([vr, omega, a_r, a_theta])

    def check(self, t, y):
        del t
        _checks.positive("mass", self.m, "Masses are in kg.")
        if not _checks.is_traced(y) and y[0] == 0:
            raise _checks.fail(
                "y0", "r not 0", "r = 0", "There theta has no meaning; start beside the origin."
            )


@ready_made()
def polar_particle(
    *effects: Effect, position=(1.0, 0.5), velocity=(-1.0, 0.0), m=1.0, t1=2.0
) -> Scene:
    """A free particle whose straight path is found in polar coordinates (problem 8).

    Args:
      effects: what acts on it; nothing in the problem.
      position: (2,) start x, y [m]; not the origin.
      velocity: (2,) start [m/s]; the default passes the origin at 0.5 m.
      m: mass [kg].
      t1: span [s].
    """
    y0 = polar_state(*floats(position, velocity))
    return Scene(PolarParticle(m), effects, y0=y0, t1=t1)


def polar_state(position: Array, velocity: Array) -> Array:
    """(4,) the state of a `PolarParticle` at a position (2,), not the origin, and velocity (2,)."""
    (x, y), (vx, vy) = position, velocity
    r2 = x * x + y * y
    r = jnp.sqrt(r2)
    return jnp.stack([r, jnp.arctan2(y, x), (x * vx + y * vy) / r, (x * vy - y * vx) / r2])


@each_motion
def straightness(motion: Trajectory) -> Array:
    """() [1] how far the path of the first point is from straight; 0 for a straight line.

    The largest distance of its samples from the straight line that fits them best, over the
    largest distance of two of them along it (problem 8 d). It says nothing about speed.

    Limits: planar motions; not differentiable for an exactly straight path.
    """
    r = motion.r[:, 0]
    x, y = (r - jnp.mean(r, axis=0, keepdims=True)).T
    lean = 0.5 * jnp.arctan2(2 * jnp.sum(x * y), jnp.sum(x * x - y * y))
    along, across = _polar_basis(lean)
    s = x * along[0] + y * along[1]
    off = x * across[0] + y * across[1]
    return jnp.max(jnp.abs(off)) / (jnp.max(s) - jnp.min(s))


def _polar_basis(theta: Array) -> tuple[Array, Array]:
    c, s = jnp.cos(theta), jnp.sin(theta)
    return jnp.stack([c, s]), jnp.stack([-s, c])


class Lorenz(System):
    """The Lorenz equations: a system without material points; x, y, z and time are pure numbers.

    x' = sigma (y - x),  y' = x (rho - z) - y,  z' = x y - beta z
    """

    sigma: Array = eqx.field(converter=as_float, default=10.0)
    rho: Array = eqx.field(converter=as_float, default=28.0)
    beta: Array = eqx.field(converter=as_float, default=8 / 3)

    def labels(self):
        return ("x", "1"), ("y", "1"), ("z", "1")

    def rate(self, t, y, effects):
        del t, effects
        x, y, z = y
        return jnp.stack([self.sigma * (y - x), x * (self.rho - z) - y, x * y - self.beta * z])


@ready_made()
def lorenz(*, sigma=10.0, rho=28.0, beta=8 / 3, y0=(1.0, 1.0, 1.0), t1=20.0) -> Scene:
    """The Lorenz system, chaotic at its usual numbers (problem 3).

    Nearby motions part like e^(0.9 t), so a solution at tolerance 1e-13 is lost after some
    35 time units whatever the method; that is right, not an error.

    Args:
      sigma: Prandtl number [1].
      rho: Rayleigh number over its critical value [1].
      beta: shape of the convection cell [1].
      y0: (3,) start.
      t1: span.
    """
    return Scene(Lorenz(sigma, rho, beta), y0=y0, t1=t1)
