"""Rigid bodies that move freely or about a pivot: course problems 51 to 53, 55 to 59 and 61.

Each scene can represent the attitude by a quaternion, a matrix or Euler angles, so that the three
can be compared. Steady motions and their stability are in `jaxdyn.analysis.precession`, for example
`jaxdyn.analysis.precession.critical_spin`.

The course is ambiguous or misprinted in these places:

- 51: moments 1, 2 and 3 are those of a flat plate, since 1 + 2 = 3; no box with a thickness has
  them.
- 53: the first equation lacks the dot over omega, the third the dot over R.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, floats
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.attitude import Quaternion, RotationMatrix
from jaxdyn.formulations.newton_euler import NewtonEuler
from jaxdyn.formulations.rigid import Pose, RigidBody, resting
from jaxdyn.geometry.euler import matrix_from_euler, omega_b_from_euler
from jaxdyn.geometry.inertia import Body, MaterialPoints, equimomental
from jaxdyn.mechanisms.euler_body import EulerBody
from jaxdyn.scene import Effect, Scene
from jaxdyn.scenes.ready_made import ready_made
from jaxdyn.scenes.satellites import BOX_EDGES, CUBE, SATELLITES, SatelliteSketch
from jaxdyn.sketch import Looks, Shape, arc, line, lines, traces

REPRESENTATIONS = ("quaternion", "matrix", "euler")

#: Pairs of the points of `jack` and `equimomental` that a drawing joins.
JACK_ARMS = ((0, 1), (2, 3), (4, 5))


def jack(m, moments, centre=(0.0, 0.0, 0.0)) -> MaterialPoints:
    """Six material points on the axes through a centre, with given principal moments (3,).

    All are at the same distance from the centre, and their masses are linear in the moments. They
    are therefore smooth functions of the moments, also for a flat body, two of whose points have no
    mass. The points of `equimomental` have equal masses, at distances that have no derivative for a
    flat body.

    Raises:
      ValueError: `moments` are not those of a body.
    """
    moments = jnp.asarray(moments, dtype=float)
    Body(m, centre, jnp.diag(moments)).check()
    return _jack(m, moments, jnp.asarray(centre, dtype=float))


@jax.jit  # one program; otherwise each operation is compiled by itself at its first call
def _jack(m: Array, moments: Array, centre: Array) -> MaterialPoints:
    second = jnp.sum(moments) / 2 - moments  # sum of m x^2, of m y^2, of m z^2
    arm = jnp.sqrt(jnp.sum(second) / m)
    r = arm * jnp.concatenate([jnp.eye(3), -jnp.eye(3)])[jnp.array([0, 3, 1, 4, 2, 5])]
    return MaterialPoints(r + centre[None], jnp.repeat(second / (2 * arm**2), 2))


def box_points(m, sides) -> MaterialPoints:
    """Nine material points of a uniform box with sides (3,) [m]: its corners and its centre.

    With a 24th of the mass in each corner and the remaining two thirds at the centre they have the
    inertia of the box, and they are the points that a drawing should show.
    """
    sides = _checks.array("sides", sides, (3,), "Along x, y and z, in m.")
    return _box_points(m, _checks.at_least_zero("sides", sides, "Along x, y and z, in m."))


@jax.jit
def _box_points(m: Array, sides: Array) -> MaterialPoints:
    corners = (jnp.array(CUBE, float) - 0.5) * sides[None]
    masses = m * jnp.concatenate([jnp.full(8, 1 / 24), jnp.full(1, 2 / 3)])
    return MaterialPoints(jnp.concatenate([corners, jnp.zeros((1, 3))]), masses)


class BoxSketch(Looks):
    """Sketch of a box from its points r (8 or more, 3): its edges and the path of a corner."""

    def __call__(self, r: Array) -> tuple[Shape, ...]:
        return lines(r, BOX_EDGES), *traces(r[:1], ["a corner"])


class JackSketch(Looks):
    """Sketch of `jack` or `equimomental` points r (6, 3): the three axes and the path of an end."""

    def __call__(self, r: Array) -> tuple[Shape, ...]:
        return lines(r, JACK_ARMS), *traces(r[2:3], ["end of axis 2"])


class TopSketch(Looks):
    """Sketch of a top from the points r (6, 3) of its `jack`: axis from the pivot, rim and cone."""

    def __call__(self, r: Array) -> tuple[Shape, ...]:
        pivot, middle = jnp.zeros(3), jnp.mean(r[4:], axis=0)
        across, up = (1.5 * (r[i] - middle) for i in (0, 2))
        rim = arc(middle, across, up)
        spokes = [jnp.stack([pivot, end, middle]) for end in rim[:: len(rim) // 4][:4]]
        tip = 1.6 * middle
        cone = Shape("line", jnp.stack(spokes))
        return line(pivot, tip), Shape("line", rim), cone, *traces(tip[None], ["tip of the axis"])


# ---- free


@ready_made()
def free_body(
    omega0=(0.01, 1.0, 0.0),
    *,
    moments=(1.0, 2.0, 3.0),
    m=1.0,
    representation: str = "quaternion",
    sequence: str = "YXZ",
    t1=60.0,
) -> Scene:
    """A body that turns freely about its centre at rest (problems 51, 52, 53).

    By default it spins about its middle axis and flips over repeatedly.

    Args:
      omega0: (3,) angular velocity at the start, when both frames agree [rad/s].
      moments: (3,) principal moments [kg m^2]; 1, 2 and 3 are those of a flat plate.
      m: mass [kg].
      representation: "quaternion", "matrix" or "euler".
      sequence: Euler angles; the default does not lock while the axis of angular momentum,
        here y, stays away from the body's z.
      t1: span [s].
    """
    matter, start = jack(m, moments), resting(None, omega0)
    return _scene(matter, JackSketch(), start, representation, sequence, t1=t1)


@ready_made()
def box(
    omega0=(0.01, 1.0, 0.0),
    *,
    sides=(3.0, 2.0, 1.0),
    m=1.0,
    representation: str = "quaternion",
    sequence: str = "YXZ",
    t1=60.0,
) -> Scene:
    """A uniform box that tumbles, drawn by its corners and edges (problems 47, 51, 53).

    Args:
      omega0: (3,) angular velocity at the start [rad/s].
      sides: (3,) sides along x, y and z [m]; a zero makes it a plate.
      m: mass [kg].
      representation: "quaternion", "matrix" or "euler".
      sequence: Euler angles, for "euler".
      t1: span [s].
    """
    matter, start = box_points(m, sides), resting(None, omega0)
    return _scene(matter, BoxSketch(), start, representation, sequence, t1=t1)


@ready_made()
def feynman_plate(
    tilt=0.05, *, spin=10.0, side=0.25, m=0.2, representation: str = "quaternion", t1=3.0
) -> Scene:
    """A square plate thrown up with a spin and a small wobble (problem 56).

    Its normal keeps the angle `tilt` to the vertical, the direction of its angular momentum, and
    completes a turn about it while the plate makes half a turn: two wobbles for one spin, in the
    limit of small tilts. Feynman's book (Surely You're Joking, 1985) has the ratio inverted;
    `precession.wobble_and_spin` measures it.

    Args:
      tilt: angle of the normal to the angular momentum [rad].
      spin: component of the angular velocity along the normal [rad/s].
      side: side of the square [m].
      m: mass [kg].
      representation: "quaternion", "matrix" or "euler" (ZXZ).
      t1: span [s].
    """
    # The vertical is (0, sin, cos) of the tilt in the body's axes, and I omega, with I_3 = 2 I_1,
    # is along it.
    tilt, spin, side = floats(tilt, spin, side)
    start = resting(*_thrown(tilt, spin))
    matter = box_points(m, _vector(side, side, 0.0))
    return _scene(matter, BoxSketch(), start, representation, "ZXZ", t1=t1)


@ready_made()
def satellite(
    name: str = "A", omega0=(0.3, 1.0, 0.2), *, representation: str = "quaternion", t1=20.0
) -> Scene:
    """Satellite A, B or C of problems 55, 57 and 58, its centre at rest at the origin.

    Simulation gives these results for the claims of 57 and 58 on motions:

    - A iii: all the motions named exist, but there are others. Between wobbles about axis 1 and
      wobbles about axis 3 are motions that approach a spin about axis 2 and flip over just once.
    - B iii and 58 are true: every motion of an axisymmetric body is a steady precession about its
      angular momentum (`precession.free_attitude`), and there is no wobble about another axis.
    - C ii is true: omega is constant.

    `scenes.satellites.antenna_trace` is the path of the tip of an antenna.

    Args:
      name: "A", "B" or "C".
      omega0: (3,) angular velocity at the start [rad/s].
      representation: "quaternion", "matrix" or "euler" (YXZ).
      t1: span [s].
    """
    body = SATELLITES[_checks.choice("name", name, SATELLITES)]()
    matter, start = equimomental(body), resting(None, omega0)
    return _scene(matter, SatelliteSketch(name), start, representation, "YXZ", t1=t1)


# ---- about a pivot


@ready_made()
def top(
    theta=0.5,
    *,
    precession=0.0,
    nutation=0.0,
    spin=250.0,
    m=0.1,
    d=0.05,
    I1=1e-4,
    I3=5e-5,
    g=9.81,
    representation: str = "quaternion",
    sequence: str = "ZXZ",
    t1=3.0,
) -> Scene:
    """A spinning top with a fixed point at the origin and z up (problems 59, 61).

    By default it is released at rest but for its spin, which is fast enough to keep it up: it nods
    and precesses. Far below `precession.critical_spin` it falls down through its pivot.

    omega = precession k + nutation e_x' + spin e_3', with e_x' along the horizontal k x e_3'.
    ``precession`` from `precession.top_roots` starts it in steady precession.

    Args:
      theta: angle of the axis e_3' to the vertical k [rad].
      precession: rate of e_3' about the vertical [rad/s].
      nutation: rate of theta [rad/s].
      spin: spin about e_3', relative to the frame that precesses [rad/s].
      m: mass [kg].
      d: distance of the centre of mass from the pivot [m].
      I1: moment across the axis, about the centre of mass [kg m^2].
      I3: moment about the axis [kg m^2].
      g: gravity [m/s^2].
      representation: "quaternion", "matrix" or "euler".
      sequence: Euler angles; ZXZ are phi, theta, psi and lock when the top is upright; XYZ do not.
      t1: span [s].
    """
    I1 = _checks.positive("I1", I1, "The moment across the axis, in kg m^2.")
    I3 = _checks.positive("I3", I3, "The moment about the axis, in kg m^2.")
    start = resting(*_leaning(*floats(theta, precession, nutation, spin)))
    matter = jack(m, _vector(I1, I1, I3), _vector(0.0, 0.0, d))
    gravity = (UniformGravity(g),)
    return _scene(
        matter, TopSketch(), start, representation, sequence, gravity, pivoted=True, t1=t1
    )


@jax.jit  # one program, not one for each operation
def _thrown(tilt: Array, spin: Array) -> tuple[Array, Array]:
    """The attitude, and the angular velocity in the body's axes, of `feynman_plate`."""
    none = jnp.zeros(())
    R_wb = matrix_from_euler(jnp.stack([none, tilt, none]), "ZXZ")
    return R_wb, jnp.stack([none, 2 * spin * jnp.tan(tilt), spin])


@jax.jit
def _leaning(theta: Array, precession: Array, nutation: Array, spin: Array) -> tuple[Array, Array]:
    """The attitude, and the angular velocity in the body's axes, of `top`."""
    none = jnp.zeros(())
    angles = jnp.stack([none, theta, none])
    rates = jnp.stack([precession, nutation, spin])
    return matrix_from_euler(angles, "ZXZ"), omega_b_from_euler(angles, "ZXZ") @ rates


def _scene(
    matter: MaterialPoints,
    drawn: Looks,
    start: Pose,
    representation: str,
    sequence: str,
    effects: tuple[Effect, ...] = (),
    *,
    pivoted: bool = False,
    t1,
) -> Scene:
    _checks.choice("representation", representation, REPRESENTATIONS)
    if representation == "euler":
        mechanism = EulerBody(matter, sequence, pivoted=pivoted, drawn=drawn)
        return Scene(NewtonEuler(mechanism), effects, y0=mechanism.state(start), t1=t1)
    attitude = Quaternion() if representation == "quaternion" else RotationMatrix()
    body = RigidBody(matter, attitude, pivoted=pivoted, drawn=drawn)
    return Scene(body, effects, y0=body.state(start), t1=t1)


def _vector(*numbers) -> Array:
    return as_float([*numbers])
