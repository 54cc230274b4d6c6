"""Bodies under mutual Newtonian gravity: course problems 16, 17, 28."""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, check_first, floats
from jaxdyn._units import GRAVITATIONAL_CONSTANT, measure
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Scene, check_scene, check_units
from jaxdyn.scenes.ready_made import ready_made

#: A rough guess of a figure-eight (problem 28), in the order x1 y1 x2 y2 x3 y3 vx1 ... [G = m = 1].
EIGHT_GUESS = (-0.755, 0.355, 1.155, -0.0755, -0.4055, -0.3055)
EIGHT_GUESS += (0.9955, 0.07855, 0.1055, 0.4755, -1.1055, -0.5355)
#: The period that goes with this guess (problem 28).
EIGHT_GUESS_PERIOD = 8.0
#: Montgomery's eight as printed in problem 17, with 8 digits.
EIGHT = (-0.97000436, 0.24308753, 0.97000436, -0.24308753, 0.0, 0.0)
EIGHT += (-0.93240737 / 2, -0.86473146 / 2, -0.93240737 / 2, -0.86473146 / 2)
EIGHT += (0.93240737, 0.86473146)
#: The period of the eight, to as many digits as the printed start has.
EIGHT_PERIOD = 6.3259140
#: Two bodies of mass 1 and one of mass 0.3 in space: a stable periodic orbit [G = 1].
TRIO = ((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -7.85343346337253e-02))
#: The velocities of the first two; that of the third makes the total momentum zero.
_TRIO_SPEEDS = (1.96265689129450e-01, 4.53772124061596e-03, -1.54272585548068e-02)
TRIO_VELOCITIES = (
    _TRIO_SPEEDS,
    (_TRIO_SPEEDS[0], _TRIO_SPEEDS[1], -_TRIO_SPEEDS[2]),
    (-2 * _TRIO_SPEEDS[0] / 0.3, -2 * _TRIO_SPEEDS[1] / 0.3, 0.0),
)
#: The period of this orbit.
TRIO_PERIOD = 7.19372451258599
_DIMENSIONS = (2, 3)


@ready_made()
def three_body(y0=EIGHT, *, m=(1.0, 1.0, 1.0), G=1.0, t1=EIGHT_PERIOD, units=()) -> Scene:
    """Three bodies in a plane under Newtonian gravity (problems 17, 28).

    Args:
      y0: (12,) start x1 y1 x2 y2 x3 y3 vx1 vy1 vx2 vy2 vx3 vy3; the figure-eight by default.
      m: (3,) masses; a body of mass 0 is a test particle.
      G: gravitational constant.
      t1: span; one period of the figure-eight by default.
      units: names of the units of length, mass and time; see `n_body`.
    """
    return Scene(FreePoints(m, d=2), (PairGravity(G),), y0=y0, t1=t1, units=units or None)


@ready_made(but=("r", "v", "m"))
def n_body(
    r=TRIO, v=TRIO_VELOCITIES, *, m=(1.0, 1.0, 0.3), G=None, names=(), t1=TRIO_PERIOD, units=()
) -> Scene:
    """Any number of bodies in space, or in a plane, under Newtonian gravity.

    By default it is a stable periodic orbit of three bodies, with the two heavy ones on one curve
    and the light one on another. `jaxdyn.read_bodies` makes such a scene of a table in a text file.

    Args:
      r: (n, 3) or (n, 2) positions [m], one row for each body.
      v: velocities [m/s], of the same shape.
      m: (n,) masses [kg]; a body of mass 0 is a test particle.
      G: gravitational constant [m^3/(kg s^2)]; by default 1, or that of nature in `units`.
      names: (n,) names of the bodies; with "Earth" the label of its x is x_Earth, not x1.
      t1: span [s].
      units: names of the units of length, mass and time in which all these numbers are, such as
        ("AU", "Msun", "day"), where they are not m, kg and s; see `Scene`. Those of mass may be kg
        and g, and the masses of the Sun, Jupiter and the Earth, "Msun", "Mjup" and "Mearth".
    Raises:
      ValueError: G is not given, and unknown in these units.
    Reference: Li, Liao (2025), arXiv:2508.08568, O_1(0.3).
    Example:
      >>> from jaxdyn import scenes
      >>> pair = scenes.n_body([[1, 0, 0], [-1, 0, 0]], [[0, 0, 0.5], [0, 0, -0.5]], m=[1.0, 1.0],
      ...                      names=["Pluto", "Charon"])
      >>> [name for name, _ in pair.labels()][:4]
      ['x_Pluto', 'y_Pluto', 'z_Pluto', 'x_Charon']
    """
    r = _checks.numbers("r", r)
    if r.ndim != 2 or r.shape[1] not in _DIMENSIONS:
        raise _checks.fail("r", "shape (any, 3), or (any, 2) in a plane", f"shape {r.shape}")
    v = _checks.array_of_shape("v", v, r.shape, "One row for each row of r.")
    m = _checks.array_of_shape("m", m, r.shape[:1], "One for each row of r.")
    y0 = jnp.concatenate([r.ravel(), v.ravel()])
    bodies = FreePoints(m, d=r.shape[1], names=names)
    gravity = PairGravity(gravitational_constant(units) if G is None else G)
    return Scene(bodies, (gravity,), y0=y0, t1=t1, units=units or None)


@check_first
def barycentric(scene: Scene) -> Scene:
    """The scene with its centre of mass at rest at the origin.

    The motion of free bodies relative to each other stays as it is, if no other forces act than
    those between them. Tables of bodies are often about the Sun, which moves.

    Args:
      scene: free points, such as `n_body` and `jaxdyn.read_bodies` make.
    Raises:
      ValueError: the scene is of another kind.
    Example:
      >>> from jaxdyn import scenes
      >>> pair = scenes.n_body([[0, 0], [1, 0]], [[0, 0], [0, 2]], m=[3.0, 1.0])
      >>> print(scenes.barycentric(pair).y0)
      [-0.25  0.    0.75  0.    0.   -0.5   0.    1.5 ]
    """
    scene = check_scene(scene)
    system = scene.system
    if not isinstance(system, FreePoints):
        got = type(system).__name__
        raise _checks.fail("scene", "free points", got, "scenes.n_body makes such a scene.")
    both = scene.y0.reshape(2, -1, system.d)  # positions and velocities
    mean = jnp.einsum("i,aid->ad", system.m, both) / jnp.sum(system.m)
    return scene.starting((both - mean[:, None]).ravel())


def gravitational_constant(units) -> float:
    """The gravitational constant in units of length, mass and time; 1 without units.

    Args:
      units: names of units; see `n_body`.
    Raises:
      ValueError: a unit is not known.
    """
    if not units:
        return 1.0
    check_units(units)
    length, mass, time = map(measure, units)
    if not (length and mass and time):
        named = ", ".join(map(str, units))
        remedy = "Pass G in these units."
        raise _checks.fail("units", "known ones, for the default of G", named, remedy)
    return GRAVITATIONAL_CONSTANT * mass.size * time.size**2 / length.size**3


@ready_made()
def two_body(*, m1=1.0, m2=2.0, d=1.0, G=1.0, t1=None, units=()) -> Scene:
    """Two unequal bodies on circles about their centre of mass at the origin (problem 16 a, b).

    Args:
      m1: mass of the first, which starts at x < 0; one of the two masses may be 0 [kg].
      m2: mass of the second [kg].
      d: distance between them [m].
      G: gravitational constant [m^3/(kg s^2)].
      t1: span [s]; one `two_body_period` by default.
      units: names of the units of length, mass and time; see `n_body`.
    """
    period = two_body_period(m1=m1, m2=m2, d=d, G=G)
    y0 = _on_circles(*floats(m1, m2, d, period))
    t1 = period if t1 is None else as_float(t1)
    return Scene(FreePoints([m1, m2]), (PairGravity(G),), y0=y0, t1=t1, units=units or None)


@jax.jit  # one program, not one for each operation
def _on_circles(m1: Array, m2: Array, d: Array, period: Array) -> Array:
    """(8,) the state of `two_body`."""
    speed, none = 2 * jnp.pi * d / period, jnp.zeros(())
    first, second = m2 / (m1 + m2), m1 / (m1 + m2)
    return jnp.stack(
        [-first * d, none, second * d, none, none, -first * speed, none, second * speed]
    )


def two_body_period(*, m1=1.0, m2=2.0, d=1.0, G=1.0) -> Array:
    """() period [s] of the circular motion: 2 pi sqrt(d^3 / (G (m1 + m2))) (problem 16 a)."""
    m1, m2 = (
        _checks.at_least_zero(name, x, "Masses are in kg; 0 is a test particle.")
        for name, x in (("m1", m1), ("m2", m2))
    )
    total, d, G = (
        _checks.positive(name, x, "On circles that attraction holds it is positive.")
        for name, x in (("m1 + m2", m1 + m2), ("d", d), ("G", G))
    )
    return _kepler(d, G, total)


@jax.jit
def _kepler(d: Array, G: Array, m: Array) -> Array:
    return 2 * jnp.pi * jnp.sqrt(d**3 / (G * m))


@ready_made()
def three_body_circular(*, m=1.0, G=10.0, diameter=3.0, t1=None) -> Scene:
    """Three equal bodies on one circle about the origin, 120 degrees apart (problem 16 c, d).

    The d = 3 of the problem is the diameter of the circle, not a distance between bodies.

    Limits: this motion is unstable. A disturbance grows like e^(0.7 w t), by a factor of 85 in a
      turn, so rounding breaks the motion up after seven or eight turns, with any solver.

    Args:
      m: mass of each [kg].
      G: gravitational constant [m^3/(kg s^2)].
      diameter: diameter of the circle [m].
      t1: span [s]; three turns by default.
    """
    w = three_body_rate(m=m, G=G, diameter=diameter)
    y0 = _on_circle(w, as_float(diameter))
    t1 = 6 * jnp.pi / w if t1 is None else as_float(t1)
    return Scene(FreePoints(jnp.full(3, m)), (PairGravity(G),), y0=y0, t1=t1)


@jax.jit
def _on_circle(w: Array, diameter: Array) -> Array:
    """(12,) the state of `three_body_circular`."""
    angle = jnp.arange(3.0) * (2 * jnp.pi / 3)
    r = 0.5 * diameter * jnp.stack([jnp.cos(angle), jnp.sin(angle)])
    v = w * jnp.stack([-r[1], r[0]])
    return jnp.concatenate([r.T.ravel(), v.T.ravel()])


def three_body_rate(*, m=1.0, G=10.0, diameter=3.0) -> Array:
    """() angular speed [rad/s] of the circular motion, sqrt(G m / (sqrt(3) R^3)) (problem 16 c).

    The side of the triangle is R sqrt(3), and the forces G m^2 / (3 R^2) of the two others add
    up to sqrt(3) times one of them, towards the centre.
    """
    m, G, diameter = (
        _checks.positive(name, x, "On a circle that attraction holds all three are positive.")
        for name, x in (("m", m), ("G", G), ("diameter", diameter))
    )
    return _rate_on_circle(m, G, diameter)


@jax.jit
def _rate_on_circle(m: Array, G: Array, diameter: Array) -> Array:
    return jnp.sqrt(G * m / (jnp.sqrt(3.0) * (0.5 * diameter) ** 3))
