"""Beads on wires, a mass in a slot, masses on a plate: course problems 26, 30, 33, 34.

x points right and y up; the turntable and the plate lie flat and feel no gravity.
"""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._floats import floats
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.guided import Cycloid, Parabola, Plate, TiedParabola, Turntable
from jaxdyn.formulations.routes import Embedding, route
from jaxdyn.scene import Scene

_NODES = 4096  # of the trapezoidal rule, which converges geometrically for periodic functions


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
      c: of the curve [1/m].
      m: mass [kg].
      g: gravity [m/s^2].
      x: at the start [m].
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


def bead_on_cycloid(
    *, c=0.125, m=1.0, g=9.81, s=1.0, speed=0.0, formulation="newton_euler", t1=10.0
) -> Scene:
    """A bead that slides on the curve y = c s^2, s being the length along it (problem 33 b).

    The curve is a cycloid (`cycloid`); the motion is that of a harmonic oscillator with period
    2 pi / sqrt(2 c g) at any amplitude. The curve stands upright at s = 1 / (2 c) and ends
    there; a faster bead ends with a status.

    Args:
      c: of the curve [1/m].
      m: mass [kg].
      g: gravity [m/s^2].
      s: at the start [m].
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


def turntable(
    *,
    d=0.5,
    m=1.0,
    m_table=1.0,
    inertia=1.0,
    speed=1.0,
    rate=1.0,
    formulation="newton_euler",
    t1=20.0,
) -> Scene:
    """A mass in a straight slot of a turntable that turns freely (problem 34).

    The mass starts at the point of the slot nearest to the centre, with the slot below it.
    With any speed along the slot the table turns by a finite angle in infinite time, see
    `turntable_limit`; with none it turns for ever, but the least displacement grows.

    Args:
      d: distance of the slot from the centre [m].
      m: sliding mass [kg].
      m_table: mass of the table, without influence [kg].
      inertia: of the table about its centre [kg m^2].
      speed: of the mass along the slot at the start [m/s].
      rate: of turning at the start [rad/s].
      formulation: "newton_euler" or "lagrange".
      t1: span [s].
    """
    system, y0 = route(
        formulation, Turntable(*floats(m, m_table, inertia, d)), [0.0, 0.0], [rate, speed], {}
    )
    return Scene(system, (), y0=y0, t1=t1)


def turntable_limit(*, d=0.5, m=1.0, inertia=1.0, speed=1.0, rate=1.0) -> Array:
    """() angle [rad] that the turntable of problem 34 approaches as time goes on.

    With A = I + m d^2, angular momentum H and energy E the two conservation laws give

        (ds/dt)^2 = (2 E (A + m s^2) - H^2) / (m (I + m s^2)),
        dtheta/ds = (H / (ds/dt) - m d) / (A + m s^2).

    The right side of the first is positive and falls to no limit but 2 E / m, so s never turns
    back and grows without bound; that of the second falls as 1 / s^2, so its integral over all
    s is finite. With s = sqrt(A / m) tan(u) it is the integral of a smooth, periodic function.

    Args:
      d: distance of the slot from the centre [m].
      m: sliding mass [kg].
      inertia: of the table about its centre, > 0 [kg m^2].
      speed: of the mass along the slot at the start, not 0 [m/s].
      rate: of turning at the start [rad/s].
    Limits: infinite or NaN at speed 0, where the mass stays and the table turns for ever.
    """
    a = inertia + m * d * d
    h = a * rate + m * d * speed
    e2 = a * rate**2 + m * speed**2 + 2 * m * d * speed * rate
    u = jnp.asarray((np.arange(_NODES) + 0.5) * (np.pi / 2 / _NODES))
    s2 = a / m * jnp.tan(u) ** 2
    s_dot = jnp.sign(speed) * jnp.sqrt((e2 * (a + m * s2) - h * h) / (m * (inertia + m * s2)))
    slope = h / s_dot - m * d
    return jnp.sign(speed) * jnp.mean(slope) * (math.pi / 2) / jnp.sqrt(m * a)


def plate(*, m=1.0, weld=2.0, centre=2.0, radius=1.0, t1=math.pi) -> Scene:
    """A massless plate that turns because masses are moved on it, at no momentum (problem 26).

    Two masses are welded to it at y = +-weld. Two others are driven round circles about
    x = +-centre, opposite to each other, by the angle (1 - cos t) pi: once round until t = pi,
    and back again if the time goes on.

    Args:
      m: each of the four masses [kg].
      weld: distance of the welded ones from the middle [m].
      centre: distance of the circles' centres from the middle [m].
      radius: of the circles [m].
      t1: span [s].
    """
    mechanism = Plate(*floats(m, weld, centre, radius))
    system, y0 = route("newton_euler", mechanism, [0.0], [0.0], {})
    return Scene(system, (), y0=y0, t1=t1)


def plate_turn(*, weld=2.0, centre=2.0, radius=1.0) -> Array:
    """() angle [rad] by which that plate has turned after one round, whatever its pace.

    No angular momentum: (|a|^2 + |r|^2) dphi + (x dy - y dx) = 0 for a welded mass at a and a
    driven one at r = (x, y) on the plate, so phi is an integral over the path.
    """
    angle = jnp.asarray(np.arange(_NODES) * (2 * np.pi / _NODES))
    x, y = centre + radius * jnp.cos(angle), radius * jnp.sin(angle)
    swept = x * radius * jnp.cos(angle) + y * radius * jnp.sin(angle)
    return -2 * math.pi * jnp.mean(swept / (weld**2 + x * x + y * y))


def cycloid(c, s: Array) -> Array:
    """(..., 2) points of the curve y = c s^2 at lengths s (...) along it (problem 33 b).

    A wheel of radius R = 1 / (8 c) rolling under the line y = 2 R, turned by phi where
    s = 4 R sin(phi / 2), draws x = R (phi + sin phi), y = R (1 - cos phi).

    Limits: NaN beyond abs(s) = 1 / (2 c), where the curve ends.
    """
    half = jnp.arcsin(2 * c * s)
    radius = 1 / (8 * c)
    return jnp.stack([radius * (2 * half + jnp.sin(2 * half)), c * s * s], axis=-1)
