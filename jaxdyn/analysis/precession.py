"""Steady precession of spinning bodies: problems 55 to 61.

`steady.linearize_steady` says whether such a motion is stable, and how fast a body nutates.

The axis e_3' of an axisymmetric body keeps an angle theta to the vertical k while

    omega = omega_p k + omega_s e_3',    omega_3 = omega_s + omega_p cos(theta).

Here omega_p is the precession, omega_s the spin relative to the frame that precesses, and omega_3
the total spin about the axis, which is conserved. Where gravity gives the moment K sin(theta) about
the line of nodes k x e_3', balance of angular momentum leaves, for sin(theta) != 0,

    I_1 cos(theta) omega_p^2 - I_3 omega_3 omega_p + K = 0,

or the same with I_1 - I_3 and omega_s in place of I_1 and omega_3. K is 0 for a free body, m g d
for a top (moments about the pivot), and -m g r cot(theta) for a disk on ice. Tops and disks also
have more general motions, with nutation; free bodies have no others.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn._arguments import arrays
from jaxdyn._checks import check_first, floats
from jaxdyn._numerics import nan_unless, safe_sqrt
from jaxdyn.formulations.rigid import Pose, pose
from jaxdyn.geometry.frames import check_rotation
from jaxdyn.geometry.rotations import (
    Matrix,
    matrix_from_rotation_vector,
    wxyz_from_matrix,
    wxyz_rate_from_body,
)
from jaxdyn.geometry.vectors import Scalar, Vector
from jaxdyn.integrate.spans import of_samples
from jaxdyn.integrate.trajectory import Trajectory, each_motion

# A leading coefficient below this part of its terms counts as 0: cos(pi / 2) in floats is not 0.
_MIN_RELATIVE_COEFFICIENT = 1e-15


class Precession(NamedTuple):
    """Precession omega_p, and spin omega_s relative to the precessing frame [rad/s]."""

    precession: Array
    spin: Array


# ---- relations


def precession_residual(theta, motion: Precession, *, I1, I3, K) -> Array:
    """Unbalanced moment () [N m] over sin(theta); 0 where a steady precession is possible."""
    cos = jnp.cos(theta)
    total = motion.spin + motion.precession * cos
    return I1 * cos * motion.precession**2 - I3 * total * motion.precession + K


def precession_roots(theta, spin, *, I1, I3, K, total: bool = False) -> Precession:
    """All steady precessions at a given tilt and spin: (2,) the slow one, then the fast one.

    NaN where there is none: both if the spin is too slow, the fast one where the equation is
    linear (an axis at right angles to k with the total given, I_1 = I_3 with the relative spin).
    A double root is returned twice, and its derivatives are infinite.

    Args:
      theta: () angle of the axis to the vertical [rad], not 0 or pi.
      spin: () about the axis [rad/s].
      I1: () moment across the axis [kg m^2], about the pivot if there is one.
      I3: () moment about the axis [kg m^2].
      K: () moment of gravity over sin(theta) [N m].
      total: whether the spin is omega_3, not omega_s.
    """
    theta, spin = floats(theta, spin)
    return _roots(theta, spin, I1, I3, K, total)


@jax.jit  # or each operation would be compiled by itself at its first call
def _roots(theta: Array, spin: Array, I1, I3, K, total) -> Precession:
    cos = jnp.cos(theta)
    a = jnp.where(total, I1, I1 - I3) * cos
    rates = _real_roots(
        a, -I3 * spin, K, linear=jnp.abs(a) <= _MIN_RELATIVE_COEFFICIENT * (I1 + I3)
    )
    along = jnp.where(total, rates * cos, 0.0)
    return Precession(rates, jnp.where(jnp.isnan(rates), jnp.nan, spin) - along)


def free_precession(theta, total, *, I1, I3) -> Precession:
    """The steady precession of a free axisymmetric body about its angular momentum.

    omega_p = I_3 omega_3 / (I_1 cos(theta)). For a flat plate, with I_3 = 2 I_1, at a small angle
    it is 2 omega_3: the plate wobbles twice as fast as it spins.
    """
    rate = I3 * total / (I1 * jnp.cos(theta))
    return Precession(rate, total - rate * jnp.cos(theta))


@arrays
def free_attitude(R0: Matrix, omega_b0: Vector, t: Scalar, *, I1: Scalar, I3: Scalar) -> Matrix:
    """R_wb (3, 3) at time t of a free axisymmetric body from any start.

    It is exp(t H / I_1) R_0 exp(t omega_s e_3'), with H the constant angular momentum in space and
    omega_s = (1 - I_3 / I_1) omega_3. So every motion is a steady precession (problem 58).

    Args:
      R0: (3, 3) attitude at the start.
      omega_b0: (3,) angular velocity at the start, in the body's axes [rad/s].
      t: () time since the start [s].
      I1: () moment across the axis [kg m^2].
      I3: () moment about the axis, the body's third [kg m^2].
    Raises:
      ValueError: R0 is not a rotation.
    """
    return _free_attitude(check_rotation("R0", R0), omega_b0, t, I1, I3)


@jax.jit
def _free_attitude(R0: Matrix, omega_b0: Vector, t: Scalar, I1: Scalar, I3: Scalar) -> Matrix:
    H = R0 @ (jnp.stack([I1, I1, I3]) * omega_b0)
    axis = jnp.array([0.0, 0.0, 1.0])
    own = matrix_from_rotation_vector(t * (1 - I3 / I1) * omega_b0[2] * axis)
    return matrix_from_rotation_vector(t * H / I1) @ R0 @ own


def top_roots(theta, spin, *, m, d, I1, I3, g=9.81, total: bool = False) -> Precession:
    """The `precession_roots` of a top; I1 is about its centre of mass, as in problem 59."""
    return precession_roots(theta, spin, I1=I1 + m * d * d, I3=I3, K=m * g * d, total=total)


class SteadyDisk(NamedTuple):
    """Precession and spin [rad/s], and the radius R [m] of the circle of a disk's centre.

    R is negative where the disk leans towards the middle of its circle, as a coin that rolls
    does: the centre is at R times the horizontal direction uphill, k x e_x'.
    """

    precession: Array
    spin: Array
    R: Array


class DiskResiduals(NamedTuple):
    """Residuals of a motion of a disk at constant lean, each ().

    The moment [N m] that the contact forces do not supply, 0 if the motion satisfies the laws of
    mechanics; the slip [m/s], 0 for rolling; the friction [N] towards uphill, 0 on ice.
    """

    moment: Array
    slip: Array
    friction: Array


@jax.jit
def disk_residuals(theta, motion: SteadyDisk, *, m, radius, I1, g=9.81) -> DiskResiduals:
    """The relations between lean, precession, spin and R in steady motions (problem 60)."""
    rate, spin, R = motion
    cos, sin = jnp.cos(theta), jnp.sin(theta)
    total = spin + rate * cos
    friction = -m * R * rate**2
    given = radius * (sin * friction - m * g * cos)
    moment = rate * sin * I1 * (2 * total - rate * cos) - given
    return DiskResiduals(moment, radius * total - R * rate, friction)


@jax.jit
def rolling_disk_circle(theta, R, *, m, radius, I1, g=9.81) -> SteadyDisk:
    """Problem 60 a: the steady rolling without slip at a given lean, round a circle of radius R.

    omega_p^2 = m g r cos(theta) / (sin(theta) (I_1 cos(theta) - (2 I_1 / r + m r) R)), and from the
    lack of slip r omega_3 = R omega_p. It is the root with omega_p > 0; the mirror image has all
    rates reversed. NaN where there is none: a disk cannot lean outwards far from the middle.

    Limits: two families are not of this form, upright (theta = pi/2): straight rolling at any
    spin, and turning on the spot, R = 0, at any omega_p.
    """
    cos, sin = jnp.cos(theta), jnp.sin(theta)
    square = m * g * radius * cos / (sin * (I1 * cos - (2 * I1 / radius + m * radius) * R))
    rate = _real_sqrt(square)
    return SteadyDisk(rate, rate * (R / radius - cos), R * jnp.ones_like(rate))


def sliding_disk_roots(theta, spin, *, m, radius, I1, g=9.81) -> Precession:
    """Problem 60 b: all steady motions without friction at a given lean and spin, (2,) as above.

    The centre is at rest (or moves along at a constant velocity). Upright, all motions with
    spin * precession = 0 are steady.
    """
    K = -m * g * radius * jnp.cos(theta) / jnp.sin(theta)
    return precession_roots(theta, spin, I1=I1, I3=2 * I1, K=K)


def frictionless_rolling_disk(theta, *, m, radius, I1, g=9.81) -> SteadyDisk:
    """Problem 60 c: steady rolling without friction, that of a coin just before it comes to rest.

    omega_p = sqrt(m g r / (I_1 sin(theta))) and omega_3 = 0: the line from the centre to the point
    of contact is the axis of rotation. Upright there is straight rolling too.
    """
    rate = jnp.sqrt(m * g * radius / (I1 * jnp.sin(theta)))
    return SteadyDisk(rate, -rate * jnp.cos(theta), jnp.zeros_like(rate))


# ---- rates of a simulated motion


class WobbleAndSpin(NamedTuple):
    """Mean rates [rad/s]: of the body's axis about z, and of a mark on the body about z."""

    wobble: Array
    spin: Array


@check_first
@each_motion
@of_samples
@eqx.filter_jit
def wobble_and_spin(motion: Trajectory) -> WobbleAndSpin:
    """Mean rates of the axis e_3' of a body about z, and of the body itself.

    The second is the turn about z of the whole attitude (its twist), phi + psi of ZXZ Euler
    angles, which is smooth also where e_3' passes through z. Both are counted from the first
    sample to the last; one that makes half a turn or more between two samples is NaN, as it
    cannot be distinguished from a slower one. The first is NaN also where e_3' is along z at a
    sample, the second where the body is upside down: the angle is undefined there.
    """
    angles, rates = jax.vmap(lambda y: _wobble_and_twist(pose(motion.scene, 0.0, y)))(motion.ys)
    faster = jnp.maximum(jnp.abs(rates[1:]), jnp.abs(rates[:-1]))
    near = jnp.max(faster * jnp.abs(jnp.diff(motion.ts))[:, None], axis=0) < jnp.pi
    turned = jnp.unwrap(angles, axis=0)
    span = motion.ts[-1] - motion.ts[0]
    return WobbleAndSpin(*nan_unless(near, (turned[-1] - turned[0]) / span))


@check_first
@each_motion
@of_samples
@eqx.filter_jit
def tilts(motion: Trajectory) -> Array:
    """(s,) angle of the body's axis e_3' to the vertical [rad]."""
    axis = _attitudes(motion)[..., 2]
    return jnp.arctan2(safe_sqrt(axis[:, 0] ** 2 + axis[:, 1] ** 2), axis[:, 2])


def _wobble_and_twist(now: Pose) -> tuple[Array, Array]:
    """(2,) the angles about z of the body's axis and of the body [rad], and (2,) their rates."""
    axis = now.R_wb[:, 2]
    moving = now.R_wb @ jnp.stack([now.omega_b[1], -now.omega_b[0], jnp.zeros(())])
    q = wxyz_from_matrix(now.R_wb)
    turning = wxyz_rate_from_body(q, now.omega_b)
    pairs = (axis[:2], moving[:2], 1.0), (q[jnp.array([0, 3])], turning[jnp.array([0, 3])], 2.0)
    angles = [part * jnp.arctan2(y, x) for (x, y), _, part in pairs]
    rates = [part * (x * v - y * u) / (x * x + y * y) for (x, y), (u, v), part in pairs]
    return jnp.stack(angles), jnp.stack(rates)


def _attitudes(motion: Trajectory) -> Array:
    return jax.vmap(lambda t, y: pose(motion.scene, t, y).R_wb)(motion.ts, motion.ys)


def _real_roots(a: Array, b: Array, c: Array, linear: Array) -> Array:
    """(2,) real roots of a x^2 + b x + c, the smaller first, without cancellation; else NaN."""
    discriminant = b * b - 4 * a * c
    root = _real_sqrt(discriminant)
    q = -(b + jnp.where(b < 0, -root, root)) / 2
    one = jnp.where(q == 0, jnp.nan, c / jnp.where(q == 0, 1.0, q))
    other = jnp.where(linear, jnp.nan, q / jnp.where(linear, 1.0, a))
    return jnp.stack([one, other])


def _real_sqrt(x: Array) -> Array:
    """The root of x; below 0 both it and its derivative are NaN."""
    return jnp.sqrt(jnp.where(x < 0, jnp.nan, x))


# ---- upright tops


def critical_spin(*, m, d, I1, I3, g=9.81) -> Array:
    """Slowest total spin () [rad/s] of a stable sleeping top.

    It is 2 sqrt(I m g d) / I_3, with I about the pivot. Above it an almost upright top also has two
    steady precessions, below it none. `steady.linearize_steady` decides it for any steady motion.
    """
    return 2 * jnp.sqrt((I1 + m * d * d) * m * g * d) / I3


def slowest_relative_spin(*, m, d, I1, I3, g=9.81) -> Array:
    """Slowest spin () [rad/s] relative to the precessing frame, almost upright.

    It is 2 sqrt((I - I_3) m g d) / I_3, with I about the pivot; 0 for I <= I_3, where steady
    precession exists at any spin. The limit of stability is `critical_spin`, not this.
    """
    excess = jnp.maximum(I1 + m * d * d - I3, 0.0)
    return 2 * safe_sqrt(excess * m * g * d) / I3
