"""Pendulums: course problems 22, 23, 29, 31, 35, 36 and the chains of 43; 24 is in `sideways`.

x points right and y up, unlike in the course, whose x points down in problems 22 to 24: its (x, y)
is our (-y, x). Angles are measured counterclockwise from hanging straight down; those of a pendulum
whose base shakes are measured clockwise from straight up.
"""

import math

import jax.numpy as jnp
import numpy as np

from jaxdyn import _checks
from jaxdyn._checks import as_float, floats
from jaxdyn.effects import HingeDamper, UniformGravity, unless_zero
from jaxdyn.formulations.choice import route
from jaxdyn.formulations.mechanism import TIES, Embedding
from jaxdyn.mechanisms.bars import Chain, FreeBars, PointMasses
from jaxdyn.mechanisms.sticks import Cart, Stick, TiedCart, TiedStick
from jaxdyn.scene import Effect, Scene
from jaxdyn.scenes.ready_made import RENAMED, ready_made


@ready_made()
def pendulum(
    *,
    length=1.0,
    m=1.0,
    g=9.81,
    angle=1.0,
    rate=0.0,
    damping=0.0,
    formulation="newton_euler",
    drift="projection",
    tie="length",
    t1=10.0,
) -> Scene:
    """A point mass on a massless rod, in its angle or in x and y with a tie (problems 22, 23).

    Args:
      length: length of the rod [m].
      m: mass [kg].
      g: gravity [m/s^2].
      angle: angle at the start, from hanging down [rad].
      rate: rate of the angle at the start [rad/s].
      damping: damping of the hinge [N m s]; exactly 0 leaves it out. Not for "constrained".
      formulation: "newton_euler" and "lagrange" in the angle, "constrained" in x and y; the
        multiplier is then the force along the rod, positive where the rod pushes [N].
      drift: for "constrained": "projection", "baumgarte" or "raw".
      tie: for "constrained": "length" differentiates the distance from the hinge, "square" its
        square, as textbooks do; without correction ("raw") the two drift differently.
      t1: span [s].
    """
    m, length = floats(m, length)
    free = Stick(m, length)
    tied = TiedStick(m, length, squared=_checks.choice("tie", tie, TIES) == "square")
    embeddings = {"constrained": Embedding(tied, free.end)}
    system, y0 = route(formulation, free, [angle], [rate], embeddings, drift)
    dampers = _dampers(damping, 1, formulation)
    return Scene(system, (UniformGravity(g), *dampers), y0=y0, t1=t1)


@ready_made()
def shaken_pendulum(
    *,
    length=1.0,
    m=1.0,
    g=9.81,
    amplitude=0.1,
    frequency=60.0,
    phase=0.0,
    angle=0.2,
    rate=0.0,
    uniform=True,
    formulation="newton_euler",
    drift="projection",
    t1=5.0,
) -> Scene:
    """An upside-down pendulum on a base that shakes up and down (problem 29).

    The base is at y = -amplitude cos(frequency t + phase). Fast shaking, with (amplitude
    frequency)^2 above 2 g L, holds the pendulum upright; L is the length of the point-mass
    pendulum with the same motion, 2/3 of the length of a uniform stick. In
    `jaxdyn.hard.cases.shaken`, `upright_chart` maps where it does and `stability_edges` finds the
    exact limits.

    Args:
      length: length of the stick [m].
      m: mass [kg].
      g: gravity [m/s^2].
      amplitude: amplitude of the base [m].
      frequency: frequency of the base [rad/s].
      phase: phase of the base at t = 0 [rad].
      angle: angle at the start, from straight up, clockwise [rad].
      rate: rate of the angle at the start [rad/s].
      uniform: whether the stick is uniform; False for a point mass at the end of a massless one.
      formulation: "newton_euler" and "lagrange" in the angle, "constrained" in x and y of the
        upper end with the stick's length as the tie.
      drift: for "constrained": "projection", "baumgarte" or "raw".
      t1: span [s].
    """
    numbers = floats(m, length, amplitude, frequency, phase)
    free = Stick(*numbers, inverted=True, uniform=uniform)
    embeddings = {"constrained": Embedding(TiedStick(*numbers, uniform=uniform), free.end)}
    system, y0 = route(formulation, free, [angle], [rate], embeddings, drift)
    return Scene(system, (UniformGravity(g),), y0=y0, t1=t1)


@ready_made(but=("damping",), renamed=RENAMED)
def double_pendulum(
    *,
    m=(1.0, 1.0),
    length=(1.0, 1.0),
    g=1.0,
    angles=(math.pi / 2, math.pi),
    rates=(0.0, 0.0),
    damping=0.0,
    relative=False,
    uniform=True,
    formulation="newton_euler",
    drift="projection",
    t1=30.0,
) -> Scene:
    """Two bars or two point masses, the upper bar level, the other straight up (problems 31, 36).

    Args:
      m: masses [kg].
      length: length of each [m].
      g: gravity [m/s^2].
      angles: angles at the start, each from hanging down [rad].
      rates: rates of the angles at the start [rad/s].
      damping: damping of each hinge, from the fixed one on, or of all [N m s]; exactly 0 leaves it
        out. Not for "constrained".
      relative: whether the second coordinate is the angle from bar to bar.
      uniform: whether the bars are uniform; False for massless rods with a point mass at the end of
        each.
      formulation: "newton_euler" and "lagrange" in the angles, "constrained" in x, y and angle
        of each bar with the hinges as ties, or in x and y of each point mass with the rods as ties.
      drift: for "constrained": "projection", "baumgarte" or "raw".
      t1: span [s].
    """
    numbers = {"m": m, "length": length, "g": g, "angles": angles, "rates": rates, "t1": t1}
    return n_pendulum(
        **numbers,
        damping=damping,
        relative=relative,
        uniform=uniform,
        formulation=formulation,
        drift=drift,
    )


@ready_made(but=("damping",), renamed=RENAMED)
def triple_pendulum(
    *,
    m=(1.0, 1.0, 1.0),
    length=(1.0, 1.0, 1.0),
    g=1.0,
    angles=(math.pi / 2, math.pi, 2.0),
    rates=(0.0, 0.0, 0.0),
    damping=0.0,
    relative=False,
    uniform=True,
    formulation="newton_euler",
    drift="projection",
    t1=10.0,
) -> Scene:
    """Three uniform bars, or three point masses, hinged in a row (problem 43).

    Args:
      m: masses [kg].
      length: length of each [m].
      g: gravity [m/s^2].
      angles: angles at the start, each from hanging down [rad].
      rates: rates of the angles at the start [rad/s].
      damping: see `double_pendulum`.
      relative: whether the coordinates are the angles from bar to bar.
      uniform: see `double_pendulum`.
      formulation: see `double_pendulum`.
      drift: for "constrained": "projection", "baumgarte" or "raw".
      t1: span [s].
    """
    numbers = {"m": m, "length": length, "g": g, "angles": angles, "rates": rates, "t1": t1}
    return n_pendulum(
        **numbers,
        damping=damping,
        relative=relative,
        uniform=uniform,
        formulation=formulation,
        drift=drift,
    )


@ready_made("m", "length", "angles", "rates", but=("damping",), renamed=RENAMED)
def n_pendulum(
    *,
    m=(1.0, 1.0, 1.0, 1.0),
    length=(1.0, 1.0, 1.0, 1.0),
    g=1.0,
    angles=(1.5, 1.5, 1.5, 1.5),
    rates=(0.0, 0.0, 0.0, 0.0),
    damping=0.0,
    relative=False,
    uniform=True,
    formulation="newton_euler",
    drift="projection",
    t1=10.0,
) -> Scene:
    """Uniform bars or point masses hinged in a row, as many as there are masses (problem 43).

    Args:
      m: masses [kg].
      length: length of each [m].
      g: gravity [m/s^2].
      angles: angles at the start, each from hanging down [rad].
      rates: rates of the angles at the start [rad/s].
      damping: see `double_pendulum`.
      relative: whether the coordinates are the angles from bar to bar.
      uniform: see `double_pendulum`.
      formulation: see `double_pendulum`.
      drift: for "constrained": "projection", "baumgarte" or "raw".
      t1: span [s].
    """
    m, length, q, v = floats(m, length, angles, rates)
    free = Chain(m, length, relative=relative, uniform=uniform)
    if relative:
        q, v = (jnp.diff(x, prepend=0.0) for x in (q, v))
    tied = FreeBars(m, length) if uniform else PointMasses(m, length)
    embeddings = {"constrained": Embedding(tied, free.free_bars if uniform else free.point_masses)}
    system, y0 = route(formulation, free, q, v, embeddings, drift)
    dampers = _dampers(damping, len(m), formulation, relative=relative)
    return Scene(system, (UniformGravity(g), *dampers), y0=y0, t1=t1)


@ready_made()
def cart_pendulum(
    *,
    m=(1.0, 1.0),
    length=1.0,
    g=9.81,
    x=0.0,
    angle=1.0,
    speed=0.0,
    rate=0.0,
    formulation="newton_euler",
    drift="projection",
    t1=10.0,
) -> Scene:
    """A cart on a level track with a point mass on a massless stick (problem 35).

    Args:
      m: masses of the cart and of the point mass [kg].
      length: length of the stick [m].
      g: gravity [m/s^2].
      x: position of the cart at the start [m].
      angle: angle of the stick at the start, from hanging down [rad].
      speed: speed of the cart at the start [m/s].
      rate: rate of the angle at the start [rad/s].
      formulation: "newton_euler" and "lagrange" in position and angle, "constrained" in the cart's
        x and the point's x and y with the stick as the tie.
      drift: for "constrained": "projection", "baumgarte" or "raw".
      t1: span [s].
    """
    m, length = floats(m, length)
    free = Cart(m, length)
    embeddings = {"constrained": Embedding(TiedCart(m, length), free.cartesian)}
    system, y0 = route(formulation, free, [x, angle], [speed, rate], embeddings, drift)
    return Scene(system, (UniformGravity(g),), y0=y0, t1=t1)


def _dampers(damping, n: int, formulation: str, relative=False) -> tuple[Effect, ...]:
    """The dampers in the hinges of n bars in a row, without those that are exactly 0."""
    # Numbers that are known remain so in a traced function, where an array of JAX would be traced.
    each = as_float(damping) if _checks.is_traced(damping) else np.asarray(damping, float)
    shape = (n,) if each.ndim else ()
    _checks.check_shape("damping", each.shape, shape, "One number for all hinges, or for each.")
    dampers: tuple[Effect, ...] = ()
    for i, c in enumerate([*each] if each.ndim else [each] * n):
        dampers += unless_zero(c, HingeDamper(c, i=i, j=i - 1 if i and not relative else None))
    if dampers and formulation == "constrained":
        remedy = "A hinge damps the angle, which that formulation does not have."
        raise _checks.fail("damping", "0 for formulation='constrained'", damping, remedy)
    return dampers
