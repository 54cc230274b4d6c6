"""A rigid body in space: Newton's law for its centre, Euler's equations for its rotation.

The body consists of material points in its own axes (the six of `inertia.equimomental`, or others
with its mass, centre and inertia), so effects act on it as on any system, and their forces f_i give

    m dv/dt = sum f_i,    I domega_b/dt = sum s_i x (R^T f_i) - omega_b x (I omega_b),

with s_i and the constant I in the body's axes. For a body with a fixed pivot the second equation
alone applies, with s_i and I about the pivot. The orientation R_wb is a unit quaternion or the
matrix itself, which are never singular; `EulerBody` uses Euler angles.

`pose` gives position, R_wb and angular velocity of any of them in both frames. The angular
momentum in space is `energy.angular_momentum`.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, check_first
from jaxdyn._numerics import solve_spd
from jaxdyn.formulations.attitude import Attitude, Quaternion
from jaxdyn.formulations.mechanism import MechanismSystem
from jaxdyn.geometry.inertia import MaterialPoints
from jaxdyn.geometry.vectors import cross
from jaxdyn.joints import Joint, body, pinned
from jaxdyn.scene import Effect, Points, Scene, System
from jaxdyn.sketch import Looks, Shape, traces
from jaxdyn.system import generalized_forces, total_force

#: Largest deviation of the attitude of a start from a unit quaternion or a rotation matrix.
CONSISTENT = 1e-9

METRES = (("x", "m"), ("y", "m"), ("z", "m"))
_SPEEDS = (("vx", "m/s"), ("vy", "m/s"), ("vz", "m/s"))
_SPINS = tuple((f"omega{i}", "rad/s") for i in (1, 2, 3))


class Pose(NamedTuple):
    """Position and velocity of a body; each field may have a leading axis of samples.

    The centre (or pivot) r and its velocity v, both (3,) in the world's axes [m, m/s];
    R_wb (3, 3), whose columns are the body's axes; omega_b (3,) in the body's axes [rad/s].
    """

    r: Array
    R_wb: Array
    v: Array
    omega_b: Array

    @property
    def omega_w(self) -> Array:
        """Angular velocity (3,) in the world's axes [rad/s]."""
        return jnp.einsum("...ij,...j->...i", self.R_wb, self.omega_b)

    def place(self, s) -> Array:
        """(3,) position [m] of the point with components s (3,) in the body's axes."""
        return self.r + jnp.einsum("...ij,j->...i", self.R_wb, jnp.asarray(s, dtype=float))


class FirstPoint(Looks):
    """The path of the first point of a body, and no shape."""

    def __call__(self, r: Array) -> tuple[Shape, ...]:
        return traces(r[:1], [""])


def resting(R_wb=None, omega_b=(0.0, 0.0, 0.0)) -> Pose:
    """A pose at the origin without velocity of the origin: the usual start of a body or a top."""
    R_wb = as_float(np.eye(3) if R_wb is None else R_wb)
    still = as_float(np.zeros(3))
    return Pose(r=still, R_wb=R_wb, v=still, omega_b=as_float(omega_b))


@check_first
def pose(scene: Scene, t: Array, y: Array) -> Pose:
    """Position, attitude and angular velocity of the body in a scene, rigid or of a mechanism.

    Along a motion: ``energy.along(rigid.pose, motion)``.
    """
    del t
    return _pose(scene, y)


@jax.jit  # or each operation would be compiled by itself at its first call
def _pose(scene: Scene, y: Array) -> Pose:
    system: Any = scene.system
    if isinstance(system, MechanismSystem):
        mechanism: Any = system.mechanism
        return mechanism.pose(*jnp.split(y, 2))
    return system.pose(y)


class RigidBody(System):
    """A rigid body: state [r, attitude, v, omega_b], or [attitude, omega_b] about a pivot.

    Attributes:
      matter: its points in its own axes, relative to the pivot if it has one. The r of a free body
        is its centre of mass, relative to which its points are stored.
      attitude: `attitude.Quaternion()` or `attitude.RotationMatrix()`.
      pivoted: whether the origin of its axes is fixed at the world's origin.
      drawn: what a drawing shows; by default the path of its first point.

    An effect's `generalized` is given q = [r, attitude], v = [v, omega_b] (without r and v about
    a pivot) and returns the conjugate forces: [force, torque in the body's axes].
    """

    matter: MaterialPoints
    attitude: Attitude
    pivoted: bool = eqx.field(static=True)
    drawn: Looks = FirstPoint()

    def __init__(
        self,
        matter: MaterialPoints,
        attitude=None,
        *,
        pivoted: bool = False,
        drawn: Looks | None = None,
    ):
        self.matter = matter if pivoted else about_centre(matter)
        self.attitude = Quaternion() if attitude is None else attitude
        self.pivoted = pivoted
        self.drawn = FirstPoint() if drawn is None else drawn

    @property
    def accepts(self):
        return frozenset({"force", "generalized"})

    def labels(self):
        turning = self.attitude.labels()
        if self.pivoted:
            return (*turning, *_SPINS)
        return (*METRES, *turning, *_SPEEDS, *_SPINS)

    def rate(self, t, y, effects):
        _, a, v, omega = self._parts(y)
        force, torque = self.load(t, y, effects)
        inertia = inertia_matrix(self.matter)
        torque = torque - gyroscopic_torque(inertia, omega)
        turning = self.attitude.rate(a, omega), solve_spd(inertia, torque)
        if self.pivoted:
            return jnp.concatenate(turning)
        return jnp.concatenate([v, turning[0], force / jnp.sum(self.matter.m), turning[1]])

    def points(self, t, y):
        del t
        r, R, v, omega = self.pose(y)
        s, m = self.matter
        return Points(r[None] + rotate(R, s), v[None] + rotate(R, _cross_rows(omega[None], s)), m)

    def coordinates(self, y):
        n = len(y) - (3 if self.pivoted else 6)
        return y[:n], y[n:]

    def sketch(self, t, y):
        del t
        r, R, _, _ = self.pose(y)
        return tuple(shape.place(r, R) for shape in self.drawn(self.matter.r))

    def bodies(self, t, y):
        del t, y
        return body("body", self.matter.m)

    def joints(self, t, y):
        del t, y
        return at_pivot(self.pivoted)

    def pose(self, y: Array) -> Pose:
        """Position, attitude and angular velocity at a state (k,)."""
        r, a, v, omega = self._parts(y)
        return Pose(r=r, R_wb=self.attitude.matrix(a), v=v, omega_b=omega)

    def state(self, pose: Pose) -> Array:
        """(k,) the state in a given pose."""
        a = self.attitude.of(pose.R_wb)
        if self.pivoted:
            return jnp.concatenate([a, pose.omega_b])
        return jnp.concatenate([pose.r, a, pose.v, pose.omega_b])

    def project(self, t, y):
        del t
        r, a, v, omega = self._parts(y)
        return self._state(r, self.attitude.nearest(a), v, omega)

    def difference(self, y1, y0):
        r, a, v, omega = self._parts(y1)
        return self._state(r, self.attitude.align(a, self._parts(y0)[1]), v, omega) - y0

    def generators(self, y):
        r, a, v, _ = self._parts(y)
        R = self.attitude.matrix(a)
        none = jnp.zeros(3)
        found = {}
        for i, axis in enumerate("xyz"):
            e = jnp.eye(3)[i]
            turning = self.attitude.rate(a, jnp.sum(R * e[:, None], axis=0))
            found[f"turn about {axis}"] = self._state(cross(e, r), turning, cross(e, v), none)
            if not self.pivoted:
                found[f"shift along {axis}"] = self._state(e, jnp.zeros_like(a), none, none)
        return found

    def check(self, t, y):
        del t
        check_matter(self.matter, self.pivoted)
        if _checks.is_traced((self, y)):
            return
        a = y[:-3] if self.pivoted else y[3:-6]
        nearest = np.asarray(_nearest(self.attitude, a))
        off = np.abs(nearest - a).max()
        if not off <= CONSISTENT:
            raise _checks.fail(
                "y0",
                f"a rotation in {', '.join(name for name, _ in self.attitude.labels())}",
                f"{a.tolist()}",
                f"The nearest one is {[float(f'{x:.12g}') for x in nearest]}.",
            )

    def load(self, t: Array, y: Array, effects: tuple[Effect, ...]) -> tuple[Array, Array]:
        """Net force (3,) in the world's axes, and torque (3,) in the body's."""
        _, a, _, _ = self._parts(y)
        total = jnp.zeros((2, 3))
        if effects:
            R = self.attitude.matrix(a)
            r, velocity, m = self.points(t, y)
            forces = total_force(effects, t, r, velocity, m)
            moments = _cross_rows(self.matter.r, rotate(R.T, forces))
            total = jnp.stack([jnp.sum(forces, axis=0), jnp.sum(moments, axis=0)])
            for f in generalized_forces(effects, t, *self.coordinates(y)):
                total = total + jnp.concatenate([jnp.zeros(6 - len(f)), f]).reshape(2, 3)
        return total[0], total[1]

    def _parts(self, y: Array) -> tuple[Array, Array, Array, Array]:
        if self.pivoted:
            return jnp.zeros(3), y[:-3], jnp.zeros(3), y[-3:]
        return y[:3], y[3:-6], y[-6:-3], y[-3:]

    def _state(self, r: Array, a: Array, v: Array, omega: Array) -> Array:
        return jnp.concatenate([a, omega] if self.pivoted else [r, a, v, omega])


def inertia_matrix(matter: MaterialPoints) -> Array:
    """The inertia matrix (3, 3) of points about the origin of their axes [kg m^2]."""
    r, m = matter
    products = jnp.sum(m[:, None, None] * r[:, :, None] * r[:, None, :], axis=0)
    trace = products[0, 0] + products[1, 1] + products[2, 2]
    return trace * jnp.eye(3) - products


def gyroscopic_torque(inertia: Array, omega: Array) -> Array:
    """The torque omega x (inertia omega) (3,) [N m].

    It is written out in products of angular velocities, three of which are squares: a Taylor series
    takes half as long for these, and moments of inertia are subtracted before any multiplication.
    """
    (a, d, e), (_, b, f), (_, _, c) = inertia
    p, q, r = omega
    pp, qq, rr, qr, rp, pq = p * p, q * q, r * r, q * r, r * p, p * q
    return jnp.stack(
        [
            (c - b) * qr - d * rp + e * pq + f * (qq - rr),
            (a - c) * rp - f * pq + d * qr + e * (rr - pp),
            (b - a) * pq - e * qr + f * rp + d * (pp - qq),
        ]
    )


#: Distance of a mass centre from the origin, relative to its body, that counts as rounding.
_CENTRED = 1e-9


@check_first
def check_matter(matter: MaterialPoints, pivoted: bool) -> None:
    """Raise ValueError for points that are not a rigid body: without mass, or all on one line.

    The points of a free body are relative to their mass centre, unless they were replaced later.
    """
    if _checks.is_traced(matter):
        return
    # A single point may have no mass, or a negative one: a hole.
    _checks.positive("mass", np.asarray(matter.m).sum(), "Masses are in kg.")
    r, m = (np.asarray(x) for x in matter)
    off = np.abs(m @ r).max()
    if not pivoted and off > _CENTRED * (np.abs(m) @ np.abs(r)).max():
        raise _checks.fail(
            "matter",
            "points of a free body about their mass centre",
            f"one {off / m.sum():.3g} from the origin",
            "Make the body again from these points, which moves them.",
        )
    moments = np.asarray(_moments(matter))
    if not moments[0] > 1e-12 * moments[2]:
        raise _checks.fail(
            "matter",
            "points that are not all on one line",
            f"principal moments {moments.tolist()}",
            "A line has no inertia about itself: take a thin cylinder.",
        )


@jax.jit
def _moments(matter: MaterialPoints) -> Array:
    return jnp.linalg.eigvalsh(inertia_matrix(matter))


@eqx.filter_jit
def _nearest(attitude: Attitude, a: Array) -> Array:
    return attitude.nearest(a)


@jax.jit
def about_centre(matter: MaterialPoints) -> MaterialPoints:
    """The points with their centre of mass at the origin."""
    r, m = matter
    return MaterialPoints(r - jnp.sum(m[:, None] * r, axis=0)[None] / jnp.sum(m), m)


def at_pivot(pivoted: bool) -> tuple[Joint, ...]:
    """What holds a body with a pivot at the origin."""
    return (pinned("pivot", 0, None, jnp.zeros(3)),) if pivoted else ()


def rotate(R: Array, s: Array) -> Array:
    """The product R s for one s (3,) or many (p, 3); a sum, as is mechanism.weighted_gram."""
    return jnp.sum(R[(None,) * (s.ndim - 1)] * s[..., None, :], axis=-1)


def _cross_rows(a: Array, b: Array) -> Array:
    """(p, 3) cross products of the rows of two arrays, one of which may have a single row."""
    return cross(a.T, b.T).T
