"""Masses on springs: course problems 3, 6, 10, 13, 20; rows of masses."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn._text import number_of
from jaxdyn.effects import (
    CubicSpring,
    Damper,
    Dashpot,
    LinearDrag,
    Spring,
    StepForce,
    UniformGravity,
    unless_zero,
)
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.trajectory import Trajectory, single
from jaxdyn.scene import Scene
from jaxdyn.scenes.particles import particle
from jaxdyn.scenes.ready_made import ready_made

_MIN_SAMPLES = 5  # fewer samples always lie on an ellipse
_MAX_UNEVENNESS = 1e-9  # largest deviation of a sample interval from the mean, over the mean


@ready_made()
def oscillator(*, k=1.0, m=1.0, c=0.0, x=1.0, v=0.0, t1=10.0) -> Scene:
    """The harmonic oscillator m x'' = -k x - c x' on a line (problem 3).

    Args:
      k: stiffness [N/m].
      m: mass [kg].
      c: damping [kg/s]; exactly 0 leaves the effect out.
      x: initial position [m].
      v: initial velocity [m/s].
      t1: span [s].
    """
    effects = (Spring(k), *unless_zero(c, LinearDrag(c)))
    return particle(*effects, position=[x], velocity=[v], m=m, t1=t1)


@ready_made("position", "velocity")
def spring_mass(
    *,
    position=(1.0, 0.0),
    velocity=(0.0, 0.0),
    k=10.0,
    length=0.5,
    m=1.0,
    g=9.81,
    t1=10.0,
) -> Scene:
    """A mass on a spring pinned at the origin, in the plane or in space (problem 6).

    Args:
      position: (d,) initial position [m], d = 2 or 3; the last axis points up.
      velocity: (d,) initial velocity [m/s].
      k: stiffness [N/m]; exactly 0 leaves the spring out.
      length: rest length [m], which may be 0.
      m: mass [kg].
      g: gravity [m/s^2]; exactly 0 leaves it out.
      t1: span [s].
    """
    effects = unless_zero(k, Spring(k, length)) + unless_zero(g, UniformGravity(g))
    return particle(*effects, position=position, velocity=velocity, m=m, t1=t1)


@ready_made("position", "velocity")
def hanging_spring(
    *, position=(1.0, 0.0, 0.0), velocity=(0.0, 1.0, 2.0), k=10.0, m=1.0, g=9.81, t1=10.0
) -> Scene:
    """A mass on a spring of rest length zero: every motion is an ellipse (problem 10).

    In space z is up. The problem asks for the wildest motion. There is none: gravity only shifts
    the centre, and all directions have the same frequency, so from any start the motion is an
    ellipse about the point m g / k below the pin, with period 2 pi sqrt(m / k)
    (`hanging_spring_exact`). `wildness` measures the deviation from an ellipse, which is 0 here but
    not for a `spring_mass` with a rest length.

    Args:
      position: (d,) initial position [m].
      velocity: (d,) initial velocity [m/s].
      k: stiffness [N/m].
      m: mass [kg].
      g: gravity [m/s^2]; exactly 0 leaves it out.
      t1: span [s].
    """
    return spring_mass(position=position, velocity=velocity, k=k, length=0.0, m=m, g=g, t1=t1)


def hanging_spring_exact(scene: Scene, t) -> Array:
    """(..., 2 d) states of a `hanging_spring` at times t (...), in closed form.

    r = c + (r0 - c) cos w t + (v0 / w) sin w t,  w^2 = k / m,  c = -(m g / k) e_z
    """
    spring = next(e for e in scene.effects if isinstance(e, Spring))
    t = jnp.asarray(t, dtype=float)[..., None]
    r0, v0 = jnp.split(scene.y0, 2)
    m = scene.system.points(jnp.zeros(()), scene.y0).m[0]
    w = jnp.sqrt(spring.k / m)
    weight = [e.g * m for e in scene.effects if isinstance(e, UniformGravity)]
    sag = sum(weight, jnp.zeros(())) / spring.k
    centre = -sag * jnp.eye(len(r0))[-1]
    arm, swing = jnp.broadcast_arrays(r0 - centre, v0 / w)
    shape = (*t.shape[:-1], len(r0))
    arm, swing = jnp.broadcast_to(arm, shape), jnp.broadcast_to(swing, shape)
    r = jnp.broadcast_to(centre, shape) + arm * jnp.cos(w * t) + swing * jnp.sin(w * t)
    v = w * (swing * jnp.cos(w * t) - arm * jnp.sin(w * t))
    return jnp.concatenate([r, v], axis=-1)


def wildness(motion: Trajectory) -> Array:
    """() deviation [1] of the path of the first point from an ellipse; 0 for every ellipse.

    For harmonic motion on an ellipse, r = c + a cos(w t) + b sin(w t), the second differences of
    equally spaced samples are proportional to r - c. The result is the root mean square of the
    residual of the best fit of the factor and c, over that of the second differences about their
    mean (problem 10).

    Args:
      motion: equally spaced samples over at least a period, about ten or more per period. Numerical
        errors contribute too, but vanish as the tolerance is tightened.
    Raises:
      ValueError: `motion` has fewer than 5 samples, unequally spaced ones, or is a batch.
    Limits: NaN for a point with constant velocity. Rounding contributes 1e-16 over the squared
      phase between samples.
    """
    r = single(motion).r[:, 0]
    if len(r) < _MIN_SAMPLES or not _even(motion.ts):
        raise _checks.fail("motion", f"{_MIN_SAMPLES} even samples or more", f"{len(r)} samples")
    bend = r[2:] - 2 * r[1:-1] + r[:-2]
    place, bend = (x - jnp.mean(x, axis=0, keepdims=True) for x in (r[1:-1], bend))
    left = bend - jnp.sum(bend * place) / jnp.sum(place * place) * place
    return jnp.sqrt(jnp.sum(left * left) / jnp.sum(bend * bend))


def _even(ts: Array) -> bool:
    steps = np.diff(np.asarray(ts))
    return bool(np.abs(steps - steps.mean()).max() <= _MAX_UNEVENNESS * np.abs(steps.mean()))


@ready_made()
def two_springs(
    *,
    position=(0.2, -1.0),
    velocity=(0.0, 0.0),
    anchor_a=(-1.0, 0.0),
    anchor_b=(1.0, 0.0),
    k_a=10.0,
    k_b=10.0,
    length_a=1.5,
    length_b=1.5,
    c_a=0.0,
    c_b=0.0,
    c_d=0.0,
    m=1.0,
    g=1.0,
    t1=10.0,
) -> Scene:
    """A mass on two springs with parallel dashpots, and air drag, y up (problem 13).

    `equilibria.equilibria` finds the equilibria, with a proof that these are all (13 c). They are:

    - Without springs: none with weight, every point without.
    - With a spring: at least one, since the energy grows in all directions and its minimum is an
      equilibrium, never an anchor from which a spring pushes away; exactly one for a heavy mass.
    - With a single spring and no weight: a circle about its anchor, if it has a rest length.
    - With two springs at different anchors and no weight: at most five. Off the line of the anchors
      both springs must be at rest length, which gives two; on each of the three parts of the line
      the force, which increases with x, vanishes at most once.
    - With two springs and weight: one to five are known, five at (k_b, length_a, length_b, g) =
      (8, 2, 0.8, 1) with k_a = 1 and anchors at (0, 0) and (0.8, 0.6). It is not proved that there
      are never more.

    Args:
      position: (2,) initial position [m].
      velocity: (2,) initial velocity [m/s].
      anchor_a: (2,) anchor A [m].
      anchor_b: (2,) anchor B [m].
      k_a: stiffness of the spring to A [N/m]; for this and all coefficients below, exactly 0 leaves
        the effect out.
      k_b: stiffness of the spring to B [N/m].
      length_a: rest length of the spring to A [m].
      length_b: rest length of the spring to B [m].
      c_a: coefficient of the dashpot to A [kg/s].
      c_b: coefficient of the dashpot to B [kg/s].
      c_d: coefficient c of the air drag c v [kg/s].
      m: mass [kg].
      g: gravity [m/s^2].
      t1: span [s].
    """
    effects = (
        *unless_zero(k_a, Spring(k_a, length_a, anchor=anchor_a)),
        *unless_zero(k_b, Spring(k_b, length_b, anchor=anchor_b)),
        *unless_zero(c_a, Dashpot(c_a, anchor=anchor_a)),
        *unless_zero(c_b, Dashpot(c_b, anchor=anchor_b)),
        *unless_zero(c_d, LinearDrag(c_d)),
        *unless_zero(g, UniformGravity(g)),
    )
    return particle(*effects, position=position, velocity=velocity, m=m, t1=t1)


@ready_made()
def two_masses(*, m1=1.0, m2=2.0, k=100.0, length=1.0, force=1.0, t1=5.0) -> Scene:
    """Two masses and a spring on a line, pushed by a step force on the second (problem 20).

    They start at rest, at 0 and at the rest length. For any k, F = (m1 + m2) a_G, since the two
    forces of the spring cancel in the sum (20 b). The masses oscillate relative to G with the
    angular frequency sqrt(k (m1 + m2) / (m1 m2)) and an amplitude proportional to 1/k, so for large
    k both move like G (20 c); see `two_masses_exact`.

    Args:
      m1: mass of the one at 0 [kg].
      m2: mass of the one at the rest length, which is pushed [kg].
      k: stiffness [N/m].
      length: rest length [m].
      force: step F0 of the force, from t = 0 on [N]; exactly 0 leaves it out.
      t1: span [s].
    """
    effects = (Spring(k, length, i=0, j=1), *unless_zero(force, StepForce([force], on=(1,))))
    y0 = as_float([0.0, length, 0.0, 0.0])
    return Scene(FreePoints([m1, m2], 1), effects, y0=y0, t1=t1)


def two_masses_exact(t, *, m1=1.0, m2=2.0, k=100.0, length=1.0, force=1.0) -> Array:
    """(..., 4) states x1, x2, v1, v2 of `two_masses` at times t (...), in closed form.

    The deviation from the motion with a rigid rod is at most F m2 / (k (m1 + m2)) for the first
    mass and F m1 / (k (m1 + m2)) for the second, times 2 m1 / (m1 + m2): the answer to 20 d.
    """
    t = jnp.asarray(t, dtype=float)
    total = m1 + m2
    w = jnp.sqrt(k * total / (m1 * m2))
    mean = force * m1 / (k * total)  # the mean stretch of the spring
    stretch = mean * 2 * jnp.sin(0.5 * w * t) ** 2
    rate = mean * w * jnp.sin(w * t)
    centre, speed = 0.5 * force / total * t * t, force / total * t
    x1, x2 = centre - m2 / total * stretch, length + centre + m1 / total * stretch
    return jnp.stack([x1, x2, speed - m2 / total * rate, speed + m1 / total * rate], axis=-1)


@ready_made("m", but=("k", "c", "cubic", "x", "v"))
def spring_chain(
    *,
    m=(1.0, 1.0),
    k=(1.0,),
    c=(0.0,),
    cubic=(0.0,),
    x=(0.0,),
    v=(0.0,),
    wall=0.0,
    wall_velocity=0.0,
    spacing=1.0,
    t1=10.0,
) -> Scene:
    """Masses in a row on a line, joined by springs and dampers, the first one also to a wall.

    A spring that is stretched by d pulls with k d + cubic d^3, and its damper with c d'. With as
    many springs as masses the last mass has a free end; with one more it is joined to a second
    wall, which is at rest. The coordinates x1, x2, ... are displacements from rest.

    Args:
      m: masses [kg], from the first wall on.
      k: stiffness of each spring, from the first wall on, or of all [N/m]; for this and the
        coefficients below, exactly 0 leaves the effect out.
      c: coefficient of each damper, or of all [kg/s].
      cubic: cubic coefficient of each spring, or of all [N/m^3].
      x: displacement of each mass at the start, or of all [m].
      v: velocity of each mass at the start, or of all [m/s].
      wall: displacement of the first wall [m].
      wall_velocity: velocity of the first wall, which acts on the damper there [m/s].
      spacing: distance of the masses at rest, in drawings alone [m].
      t1: span [s].
    """
    m = as_float(m)
    n = len(m)
    if n == 0:
        raise _checks.fail("m", "at least one mass", "none")
    x, v = (_for_each(name, _entries(one), n, n) for name, one in (("x", x), ("v", v)))
    given = {"k": _entries(k), "c": _entries(c), "cubic": _entries(cubic)}
    springs = max(n, *map(len, given.values()))
    k, c, cubic = (_for_each(name, one, n, springs) for name, one in given.items())
    # Each spring joins a mass to the one before; the first and the last may join one to a wall.
    ends = [(0, None), *((i, i - 1) for i in range(1, n)), (n - 1, None)][:springs]
    at, moving = ([one] + [0.0] * (springs - 1) for one in (wall, wall_velocity))
    effects = []
    for (i, j), stiffness, anchor in zip(ends, k, at, strict=True):
        effects += unless_zero(stiffness, Spring(stiffness, anchor=anchor, i=i, j=j))
    for (i, j), beta, anchor in zip(ends, cubic, at, strict=True):
        effects += unless_zero(beta, CubicSpring(beta, anchor=anchor, i=i, j=j))
    for (i, j), damping, velocity in zip(ends, c, moving, strict=True):
        effects += unless_zero(damping, Damper(damping, velocity=velocity, i=i, j=j))
    _checks.check_untraced("spacing", spacing, "It is for drawings; give a number.")
    system = FreePoints(m, 1, rest=[(spacing * (i + 1),) for i in range(n)])
    return Scene(system, tuple(effects), y0=as_float([*x, *v]), t1=t1)


def _entries(x) -> list:
    """The numbers, one for each or one for all; those of a tuple stay as they are.

    So a zero beside a traced number, as in (k, 0.0), still leaves its effect out.
    """
    if isinstance(x, list | tuple):
        return list(x)
    x = as_float(x)
    x = x if _checks.is_traced(x) else np.asarray(x)  # entries of a device array take time
    return list(x) if x.ndim else [x]


def _for_each(name: str, given: list, n: int, count: int) -> list:
    """A number for each of `count` masses or springs of a chain of n, given for each or for all."""
    if len(given) not in (1, count) or count > n + 1:
        wanted = f"{n} or {n + 1}" if count > n + 1 else count
        each = f"{wanted}, one for each {'mass' if name in ('x', 'v') else 'spring'}"
        raise _checks.fail(name, f"one number, or {each}", number_of(len(given), "number"))
    return given * count if len(given) == 1 else given
