"""Beads on wires, a mass in a slot, masses on a plate: course problems 26, 30, 33, 34.

x points right and y up; the turntable and the plate are horizontal, without gravity.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import floats
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.choice import route
from jaxdyn.formulations.mechanism import Embedding
from jaxdyn.mechanisms.guided import Cycloid, Parabola, Plate, TiedParabola, Turntable
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import ready_made

_NODES = 4096  # nodes of the trapezoidal rule, which converges geometrically in log(s)
_TAIL = 40.0  # range beyond either end, in log(s): it truncates e^-40 of the whole


@ready_made()
def bead_on_parabola(
    *,
    c=1.0,
    m=1.0,
    g=9.81,
    x=1.0,
    speed=0.0,
    formulation="newton_euler",
    drift="projection",
    t1=10.0,
) -> Scene:
    """A bead that slides on the curve y = c x^2 (problems 30, 33).

    Args:
      c: coefficient of the curve [1/m].
      m: mass [kg].
      g: gravity [m/s^2].
      x: initial x [m].
      speed: rate of x at the start [m/s].
      formulation: "newton_euler" and "lagrange" in x, "constrained" in x and y on the wire.
      drift: for "constrained": "projection", "baumgarte" or "raw".
      t1: span [s].
    """
    m, c = floats(m, c)
    free = Parabola(m, c)
    embeddings = {"constrained": Embedding(TiedParabola(m, c), free.place)}
    system, y0 = route(formulation, free, [x], [speed], embeddings, drift)
    return Scene(system, (UniformGravity(g),), y0=y0, t1=t1)


@ready_made()
def bead_on_cycloid(
    *, c=0.125, m=1.0, g=9.81, s=1.0, speed=0.0, formulation="newton_euler", t1=10.0
) -> Scene:
    """A bead that slides on the curve y = c s^2, with s the arc length (problem 33 b).

    The curve is a cycloid (`cycloid`); the motion is that of a harmonic oscillator with period
    2 pi / sqrt(2 c g) at any amplitude. The curve is vertical at s = 1 / (2 c) and ends
    there; the motion of a faster bead ends with a status.

    Args:
      c: coefficient of the curve [1/m].
      m: mass [kg].
      g: gravity [m/s^2].
      s: initial s [m].
      speed: rate of s at the start [m/s].
      formulation: "newton_euler" or "lagrange".
      t1: span [s].
    """
    free = Cycloid(*floats(m, c))
    if not _checks.is_traced((c, s)) and c > 0 and not abs(2 * c * s) < 1:
        end = f"{1 / (2 * c):.6g}"
        raise _checks.fail("s", f"less than {end} m from the bottom, where the curve ends", s)
    system, y0 = route(formulation, free, [s], [speed], {})
    return Scene(system, (UniformGravity(g),), y0=y0, t1=t1)


@ready_made()
def turntable(
    *,
    d=0.5,
    m=1.0,
    m_table=1.0,
    inertia=1.0,
    speed=1.0,
    rate=1.0,
    formulation="newton_euler",
    t1=3.0,
) -> Scene:
    """A mass in a straight slot of a turntable that turns freely (problem 34).

    The mass starts at the point of the slot nearest to the centre, with the slot below it.
    With any speed along the slot the table turns by a finite angle in infinite time, see
    `turntable_limit`. Without speed the mass stays there and the table keeps turning. This is an
    unstable steady state, from which any displacement grows like exp(w t), w = rate
    sqrt(1 + m d^2 / I).

    Limits: for speed = 0 rounding is such a displacement. A simulation leaves the steady state
      after about 35 / w (16 s for the default parameters), in an arbitrary direction.

    Args:
      d: distance of the slot from the centre [m].
      m: sliding mass [kg].
      m_table: mass of the table, without influence [kg].
      inertia: moment of inertia of the table about its centre [kg m^2].
      speed: speed of the mass along the slot at the start [m/s].
      rate: rate of turning at the start [rad/s].
      formulation: "newton_euler" or "lagrange".
      t1: span [s].
    """
    m, m_table, inertia, d = floats(m, m_table, inertia, d)
    free = Turntable(m=m, m_table=m_table, inertia=inertia, d=d)
    system, y0 = route(formulation, free, [0.0, 0.0], [rate, speed], {})
    return Scene(system, (), y0=y0, t1=t1)


def turntable_limit(*, d=0.5, m=1.0, inertia=1.0, speed=1.0, rate=1.0) -> Array:
    """() angle [rad] that the turntable of problem 34 approaches as time goes to infinity.

    With A = I + m d^2, angular momentum H and energy E = (H^2 + m I v^2) / (2 A), v being the
    speed at the start, the two conservation laws give

        (ds/dt)^2 = (I v^2 + 2 E s^2) / (I + m s^2),
        dtheta/ds = (H / (ds/dt) - m d) / (A + m s^2).

    The right side of the first is positive and tends to 2 E / m, so s grows monotonically and
    without bound; that of the second falls like 1 / s^2, so its integral over all s is finite.
    Its first part is an elliptic integral, whose integrand varies near s = v sqrt(I / (2 E)) and
    s = sqrt(A / m). As a function of log(s) it is smooth however far apart these are; at small
    speeds they are far apart, and the angle grows like log(1 / v).

    Args:
      d: distance of the slot from the centre [m].
      m: sliding mass [kg].
      inertia: moment of inertia of the table about its centre, > 0 [kg m^2].
      speed: speed of the mass along the slot at the start [m/s].
      rate: rate of turning at the start [rad/s].
    Returns:
      The angle, accurate to 1e-14 of its largest part; infinite at speed 0, with the sign of the
      rate, and 0 where nothing moves.
    Raises:
      ValueError: an argument is not one finite number.
    Example:
      >>> round(float(turntable_limit(speed=1e-8)), 9)
      17.32055798
    """
    given = {"d": d, "m": m, "inertia": inertia, "speed": speed, "rate": rate}
    several = "jax.vmap takes several."
    d, m, inertia, speed, rate = (_checks.array(n, x, (), several) for n, x in given.items())
    still = speed == 0
    v = jnp.where(still, 1.0, jnp.abs(speed))
    a = inertia + m * d * d
    h = a * rate + m * d * jnp.sign(speed) * v
    fastest = jnp.sqrt((h * h + m * inertia * v * v) / a)  # sqrt(2 E), without cancellation
    near = v * jnp.sqrt(inertia) / fastest
    far = jnp.sqrt(a / m)
    low = jax.lax.stop_gradient(jnp.log(jnp.minimum(near, far)) - _TAIL)
    high = jax.lax.stop_gradient(jnp.log(jnp.maximum(near, far)) + _TAIL)
    s = jnp.exp(low + (high - low) * jnp.asarray((np.arange(_NODES) + 0.5) / _NODES))
    time = jnp.sqrt(inertia + m * s * s) / (fastest * jnp.hypot(near, s))  # dt / ds
    turned = h * (high - low) * jnp.mean(s * time / (a + m * s * s))
    limit = turned - jnp.sign(speed) * m * d * (math.pi / 2) / jnp.sqrt(m * a)
    for_ever = jnp.where(rate == 0, 0.0, jnp.where(rate > 0, jnp.inf, -jnp.inf))
    return jnp.where(still, for_ever, limit)


@ready_made()
def plate(*, m=1.0, weld=2.0, centre=2.0, radius=1.0, t1=math.pi) -> Scene:
    """A massless plate, turned by masses that move on it without angular momentum (problem 26).

    Two masses are welded to it at y = +-weld. Two others are driven on circles about x = +-centre,
    opposite to each other, by the angle (1 - cos t) pi: one revolution until t = pi, then back.

    Args:
      m: mass of each of the four [kg].
      weld: distance of the welded masses from the middle [m].
      centre: distance of the circles' centres from the middle [m].
      radius: radius of the circles [m].
      t1: span [s].
    """
    m, weld, centre, radius = floats(m, weld, centre, radius)
    mechanism = Plate(m=m, weld=weld, centre=centre, radius=radius)
    system, y0 = route("newton_euler", mechanism, [0.0], [0.0], {})
    return Scene(system, (), y0=y0, t1=t1)


def plate_turn(*, weld=2.0, centre=2.0, radius=1.0) -> Array:
    """() angle [rad] by which the `plate` has turned after one revolution, at any speed.

    Without angular momentum, (|a|^2 + |r|^2) dphi + (x dy - y dx) = 0 for a welded mass at a and a
    driven one at r = (x, y) on the plate, so phi is an integral over the path. With weld w,
    centre c and radius b it is -pi (1 - cos(beta)), where beta is the angle of a triangle with
    tan(beta) = 2 b w / (w^2 + c^2 - b^2).

    Example:
      >>> round(float(plate_turn(weld=2.0, centre=2.0, radius=1.0)), 12)  # -pi (1 - 7 / sqrt(65))
      -0.413926376762
    """
    weld, centre, radius = floats(weld, centre, radius)
    beta = jnp.arctan2(2 * radius * weld, weld**2 + (centre - radius) * (centre + radius))
    return -2 * math.pi * jnp.sin(0.5 * beta) ** 2


def cycloid(c, s: Array) -> Array:
    """(..., 2) points of the curve y = c s^2 at lengths s (...) along it (problem 33 b).

    A wheel of radius R = 1 / (8 c) that rolls under the line y = 2 R traces x = R (phi + sin phi),
    y = R (1 - cos phi), with s = 4 R sin(phi / 2) at the angle phi of the wheel.

    Limits: NaN beyond abs(s) = 1 / (2 c), where the curve ends.
    """
    half = jnp.arcsin(2 * c * s)
    radius = 1 / (8 * c)
    return jnp.stack([radius * (2 * half + jnp.sin(2 * half)), c * s * s], axis=-1)
