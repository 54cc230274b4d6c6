"""Euler angles in all 12 sequences, about the body's axes or the world's.

A sequence is three letters. Capitals, ``"ZYX"``, turn about the body's current axes
(intrinsic): R_wb = R_z(a0) R_y(a1) R_x(a2). Lower case, ``"zyx"``, turns about the world's
fixed axes (extrinsic): R_wb = R_x(a2) R_y(a1) R_z(a0). Angles are (3,) [rad], in the order in
which the turns are made. Conventions of the matrices are those of `jaxdyn.geometry.rotations`.

Where the second turn makes the first and third axes parallel (gimbal lock) one rotation has many
triples of angles and some angular velocities need infinite rates. Both are reported by flags.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdyn import _checks
from jaxdyn._arguments import arrays
from jaxdyn._numerics import safe_norm
from jaxdyn.geometry.frames import Matrix, check_rotation
from jaxdyn.geometry.indices import levi_civita
from jaxdyn.geometry.vectors import Vector, cross, dot

Angles = Float[Array, "3"]

_BODY = tuple(a + b + c for a in "XYZ" for b in "XYZ" for c in "XYZ" if a != b and b != c)
SEQUENCES = _BODY + tuple(sequence.lower() for sequence in _BODY)

# Sine of the angle between the first and third axes below which they count as parallel: rounding
# of the matrix then leaves no digit of the individual angles.
_MIN_SINE = 1e-13


class EulerAngles(NamedTuple):
    """Angles (3,) [rad] and whether () they are one choice of many (gimbal lock)."""

    angles: Angles
    locked: Bool[Array, ""]


class EulerRates(NamedTuple):
    """Rates (3,) [rad/s] of the angles; NaN where ``locked`` ()."""

    rates: Angles
    locked: Bool[Array, ""]


@arrays
def matrix_from_euler(angles: Angles, sequence: str) -> Matrix:
    """R_wb (3, 3) of three turns by angles (3,) in the given sequence.

    Example:
      >>> import jax.numpy as jnp
      >>> R = matrix_from_euler(jnp.array([jnp.pi / 2, 0.0, 0.0]), "ZYX")
      >>> [round(float(x)) for x in R[:, 0]]  # x is turned to y
      [0, 1, 0]
    """
    first, second, third = _turns(angles, sequence)
    return _product(_product(first, second), third)


@arrays
def euler_from_matrix(R_wb: Matrix, sequence: str) -> EulerAngles:
    """Angles from which `matrix_from_euler` recovers R_wb to rounding, also close to gimbal lock.

    The second angle is in [-pi/2, pi/2] for three different axes and in [0, pi] where the first
    axis recurs; the others are in [-pi, pi]. In gimbal lock the turn made about the outermost
    axis (the first of a sequence about the body's axes, the last about the world's) is set to 0.

    Raises:
      ValueError: R_wb is not a rotation; under traces the result is NaN then.
    """
    R_wb = check_rotation("R_wb", R_wb)
    i, j, k, again = _axes(sequence)
    sign = levi_civita()[i, j, k]
    # Tait-Bryan: column k is R_i R_j e_k; Euler: column i is R_i R_j e_i. Its part across e_i
    # shows the outer angle.
    y, x = (R_wb[j, i], -sign * R_wb[k, i]) if again else (-sign * R_wb[j, k], R_wb[k, k])
    locked = safe_norm(jnp.stack([y, x])) < _MIN_SINE
    outer = jnp.arctan2(jnp.where(locked, 0.0, y), jnp.where(locked, 1.0, x))
    # The other angles come from the matrix with that turn undone: unlike the textbook's formulas,
    # which take each angle from R alone, this leaves no error of the outer angle in the product.
    M = _turn(i, -outer) @ R_wb
    if again:
        middle = jnp.arctan2(-sign * M[k, i], M[i, i])
        inner = jnp.arctan2(-sign * M[j, k], M[j, j])
    else:
        middle = jnp.arctan2(sign * M[i, k], M[k, k])
        inner = jnp.arctan2(sign * M[j, i], M[j, j])
    angles = [outer, middle, inner]
    return EulerAngles(jnp.stack(angles if sequence.isupper() else angles[::-1]), locked)


@arrays
def omega_w_from_euler(angles: Angles, sequence: str) -> Matrix:
    """The matrix E (3, 3) with omega_w = E @ d(angles)/dt; its columns are the turns' axes."""
    outer, middle, _ = _turns(angles, sequence)
    i, j, k, again = _axes(sequence)
    e = jnp.eye(3)
    axes = [e[i], outer @ e[j], outer @ middle @ e[i if again else k]]
    return jnp.stack(axes if sequence.isupper() else axes[::-1], axis=1)


@arrays
def omega_b_from_euler(angles: Angles, sequence: str) -> Matrix:
    """The matrix E (3, 3) with omega_b = E @ d(angles)/dt."""
    return matrix_from_euler(angles, sequence).T @ omega_w_from_euler(angles, sequence)


@arrays
def euler_rates_from_world(angles: Angles, omega_w: Vector, sequence: str) -> EulerRates:
    """Rates of the angles at an angular velocity omega_w (3,) [rad/s]; NaN in gimbal lock."""
    return _solve(omega_w_from_euler(angles, sequence), omega_w)


@arrays
def euler_rates_from_body(angles: Angles, omega_b: Vector, sequence: str) -> EulerRates:
    """Rates of the angles at an angular velocity omega_b (3,) [rad/s]; NaN in gimbal lock."""
    return _solve(omega_b_from_euler(angles, sequence), omega_b)


def _axes(sequence: str) -> tuple[int, int, int, bool]:
    """Outer and middle axis, the third axis of space, and whether the outer one recurs."""
    _checks.choice("sequence", sequence, SEQUENCES)
    order = ["XYZ".index(letter) for letter in sequence.upper()]
    i, j, k = order if sequence.isupper() else order[::-1]
    return i, j, 3 - i - j, i == k


def _turns(angles: Angles, sequence: str) -> tuple[Matrix, Matrix, Matrix]:
    """The three turns with R_wb = outer @ middle @ inner: fixed axes are body axes backwards."""
    i, j, k, again = _axes(sequence)
    outer, middle, inner = angles if sequence.isupper() else angles[::-1]
    return _turn(i, outer), _turn(j, middle), _turn(i if again else k, inner)


def _turn(axis: int, angle: Array) -> Matrix:
    """`matrix_from_axis_angle` about a known axis, in a fifth of the operations."""
    e = np.eye(3)
    along = np.outer(e[axis], e[axis])
    across = -levi_civita()[:, :, axis]
    turned = jnp.cos(angle) * (e - along) + jnp.sin(angle) * across
    return jnp.asarray(along) + turned


def _product(A: Matrix, B: Matrix) -> Matrix:
    # Written as a sum: XLA on CPU gives a small matrix product a kernel of its own, which would
    # keep a stepping loop from being folded (10 times slower for a body by Euler angles).
    return jnp.sum(A[:, :, None] * B[None, :, :], axis=1)


def _solve(E: Matrix, omega: Vector) -> EulerRates:
    # Solved by cofactors: neighbours among the three unit columns are orthogonal, so the
    # determinant is the sine of the angle between the outer two.
    a, b, c = E.T
    normals = cross(b, c), cross(c, a), cross(a, b)
    det = dot(a, normals[0])
    locked = jnp.abs(det) < _MIN_SINE
    rates = jnp.stack([dot(n, omega) for n in normals]) / jnp.where(locked, 1.0, det)
    return EulerRates(jnp.where(locked, jnp.nan, rates), locked)
