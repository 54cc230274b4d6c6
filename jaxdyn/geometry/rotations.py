"""Rotations in space: axis and angle, rotation vectors, matrices and quaternions.

``R_wb`` takes components of a vector in the body's axes to its components in the world's, and as
an operator it takes the world's axes to the body's. Quaternions are ``wxyz``, the scalar first,
and q and -q are one rotation. Angular velocity is ``omega_w`` in the world's axes and ``omega_b``
in the body's. A rotation vector is the axis times the angle. One rotation follows another by the
product ``R2 @ R1`` or ``multiply_wxyz(q2, q1)``. Angles are in rad.

Every function is for one object; ``jax.vmap`` makes it one for many. All are free of LAPACK.
Derivatives are right to any order wherever the result is smooth (for `matrix_from_rotation_vector`
everywhere) and finite elsewhere. Euler angles are in `jaxdyn.geometry.euler`, components of vectors
and tensors in two bases in `jaxdyn.geometry.frames`.

Reference: Sola (2017), Quaternion kinematics for the error-state Kalman filter.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdyn import _doors
from jaxdyn._arguments import arrays
from jaxdyn._numerics import atanc, cos_of_root, safe_norm, sinc_of_root, square_norm
from jaxdyn.geometry.frames import Matrix, check_rotation
from jaxdyn.geometry.vectors import Scalar, Vector, cross, dot, skew

Wxyz = Float[Array, "4"]


class AxisAngle(NamedTuple):
    """A unit axis (3,) and an angle () [rad] about it, from 0 to pi if a function returned it."""

    axis: Vector
    angle: Array


# ---- axis and angle


@arrays
def rotate(n: Vector, theta: Scalar, r: Vector) -> Vector:
    """The vector r (3,) turned about the axis n (3,), of any length > 0, by theta () [rad].

    It is n n.r + cos(theta) (r - n n.r) + sin(theta) n x r, with n of length 1; NaN for n = 0.
    """
    n = n / jnp.sqrt(square_norm(n))
    along = n * dot(n, r)
    return along + jnp.cos(theta) * (r - along) + jnp.sin(theta) * cross(n, r)


@arrays
def matrix_from_axis_angle(n: Vector, theta: Scalar) -> Matrix:
    """The matrix (3, 3) of `rotate`: n n^T + cos(theta) (1 - n n^T) + sin(theta) skew(n)."""
    n = n / jnp.sqrt(square_norm(n))
    along = n[:, None] * n[None, :]
    return along + jnp.cos(theta) * (jnp.eye(3) - along) + jnp.sin(theta) * skew(n)


@arrays
def axis_angle_from_matrix(R: Matrix) -> AxisAngle:
    """Axis and angle of a rotation matrix (3, 3), to rounding at every angle from 0 to pi.

    Limits: at angle 0 every axis is right, and z is returned; at pi both n and -n are right, and
    one of them is returned. The derivative of the axis is 0 at angle 0, where it has none; those of
    axis and angle are one-sided at pi.

    Raises:
      ValueError: R is not a rotation; under traces the result is NaN then.
    """
    return axis_angle_from_wxyz(wxyz_from_matrix(R))


@arrays
def compose_axis_angle(first: AxisAngle, then: AxisAngle) -> AxisAngle:
    """The one rotation that equals a first and then a second."""
    return axis_angle_from_wxyz(
        multiply_wxyz(wxyz_from_axis_angle(*then), wxyz_from_axis_angle(*first))
    )


# ---- rotation vectors


@arrays
def matrix_from_rotation_vector(phi: Vector) -> Matrix:
    """exp(skew(phi)) (3, 3): the rotation by |phi| about phi (3,); smooth everywhere."""
    return matrix_from_wxyz(wxyz_from_rotation_vector(phi))


@arrays
def rotation_vector_from_matrix(R: Matrix) -> Vector:
    """The shortest rotation vector (3,) of a rotation, its logarithm; smooth for angles below pi.

    Raises:
      ValueError: R is not a rotation; under traces the result is NaN then.
    """
    return rotation_vector_from_wxyz(wxyz_from_matrix(R))


# ---- quaternions


@arrays
def multiply_wxyz(p: Wxyz, q: Wxyz) -> Wxyz:
    """The product p q (4,): the rotation q followed by p."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return jnp.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ]
    )


@arrays
def conjugate_wxyz(q: Wxyz) -> Wxyz:
    """The conjugate (4,); of a unit quaternion, the inverse rotation."""
    return jnp.stack([q[0], -q[1], -q[2], -q[3]])


@arrays
def normalize_wxyz(q: Wxyz) -> Wxyz:
    """The unit quaternion q / |q| (4,); NaN for q = 0."""
    return q / jnp.sqrt(square_norm(q))


@arrays
def rotate_by_wxyz(q: Wxyz, r: Vector) -> Vector:
    """The vector q r q^-1 (3,), from the body's axes to the world's; q of any length > 0."""
    v = q[1:]
    twist = cross(v, r) * (2 / square_norm(q))
    return r + q[0] * twist + cross(v, twist)


@arrays
def matrix_from_wxyz(q: Wxyz) -> Matrix:
    """R_wb (3, 3) of a quaternion; a rotation for q of any length > 0, NaN for q = 0."""
    w, x, y, z = q
    s = 2 / square_norm(q)
    rows = [
        [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
    ]
    return jnp.stack([jnp.stack(row) for row in rows])


@arrays
def wxyz_from_matrix(R: Matrix) -> Wxyz:
    """Unit quaternion (4,) of a rotation matrix, w >= 0.

    The products of its components, 4 q q^T, are linear in R. Each row is q times a number, and
    the row of the largest component is taken, so nothing cancels (Shepperd's choice). It is
    normalised after the choice, so that no branch which is not taken contains a root of zero.

    Raises:
      ValueError: R is not a rotation; under traces the result is NaN then.
    """
    return _wxyz(check_rotation("R", R))


@jax.jit  # or each operation would be compiled by itself at its first call
def _wxyz(R: Matrix) -> Wxyz:
    a, b, c = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    d, e, f = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    x, y, z = R[0, 0], R[1, 1], R[2, 2]
    rows = [
        [1 + x + y + z, a, b, c],
        [a, 1 + x - y - z, d, e],
        [b, d, 1 - x + y - z, f],
        [c, e, f, 1 - x - y + z],
    ]
    row, largest = jnp.stack(rows[0]), rows[0][0]
    for k in (1, 2, 3):
        row = jnp.where(rows[k][k] > largest, jnp.stack(rows[k]), row)
        largest = jnp.maximum(largest, rows[k][k])
    return normalize_wxyz(jnp.where(row[0] < 0, -row, row))


@arrays
def wxyz_from_axis_angle(n: Vector, theta: Scalar) -> Wxyz:
    """Unit quaternion (4,) of a turn by theta () about n (3,) of any length > 0."""
    n = n / jnp.sqrt(square_norm(n))
    return jnp.concatenate([jnp.cos(theta / 2)[None], jnp.sin(theta / 2) * n])


@arrays
def axis_angle_from_wxyz(q: Wxyz) -> AxisAngle:
    """Axis and angle of a quaternion of any length > 0; see `axis_angle_from_matrix`."""
    q = _upper(q)
    s = safe_norm(q[1:])
    none = s == 0
    z = jnp.array([0.0, 0.0, 1.0])
    axis = jnp.where(none, z, q[1:] / jnp.where(none, 1.0, s))
    return AxisAngle(axis, 2 * jnp.arctan2(s, q[0]))


@arrays
def wxyz_from_rotation_vector(phi: Vector) -> Wxyz:
    """Unit quaternion (4,) of a rotation vector (3,), its exponential; smooth everywhere."""
    half = square_norm(phi) / 4
    return jnp.concatenate([cos_of_root(half)[None], sinc_of_root(half) * phi / 2])


@arrays
def rotation_vector_from_wxyz(q: Wxyz) -> Vector:
    """Shortest rotation vector (3,) of a quaternion; smooth for angles below pi.

    The quaternion is of any length > 0; NaN for q = 0.
    """
    q = _upper(q)
    return 2 * atanc(square_norm(q[1:]), q[0]) * q[1:]


# ---- rates


@arrays
def wxyz_rate_from_body(q: Wxyz, omega_b: Vector) -> Wxyz:
    """dq/dt = q (0, omega_b) / 2 (4,) [1/s]."""
    return multiply_wxyz(q, _pure(omega_b)) / 2


@arrays
def wxyz_rate_from_world(q: Wxyz, omega_w: Vector) -> Wxyz:
    """dq/dt = (0, omega_w) q / 2 (4,) [1/s]."""
    return multiply_wxyz(_pure(omega_w), q) / 2


@arrays
def matrix_rate_from_body(R_wb: Matrix, omega_b: Vector) -> Matrix:
    """dR/dt = R skew(omega_b) (3, 3) [1/s]."""
    return R_wb @ skew(omega_b)


@arrays
def matrix_rate_from_world(R_wb: Matrix, omega_w: Vector) -> Matrix:
    """dR/dt = skew(omega_w) R (3, 3) [1/s]."""
    return skew(omega_w) @ R_wb


# ---- private


def _upper(q: Wxyz) -> Wxyz:
    """q or -q, whichever has a scalar that is not negative; NaN for q = 0, not a rotation."""
    return jnp.where(square_norm(q) == 0, jnp.nan, jnp.where(q[0] < 0, -q, q))


def _pure(v: Vector) -> Wxyz:
    return jnp.concatenate([jnp.zeros_like(v[:1]), v])


#: Renamed in version 0.3.
_RENAMED = {"normalise_wxyz": "normalize_wxyz"}
__getattr__ = _doors.attribute_getter(__name__, renamed=_RENAMED)
