"""Rotation matrices in general: components in two bases, and what makes a matrix a rotation.

A matrix ``R_wb`` takes components of a vector in the body's axes to its components in the world's;
how one is made of an axis, an angle or a quaternion is in `jaxdyn.geometry.rotations`.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import _checks, _doors
from jaxdyn._arguments import arrays
from jaxdyn._numerics import nan_unless
from jaxdyn.geometry.vectors import cross, dot

Matrix = Float[Array, "3 3"]

# Largest deviation of R^T R from 1, half the digits of a float. A larger one is not the drift of a
# motion, but a matrix that was typed with few digits, scaled, or is not a rotation.
_MAX_ORTHOGONALITY_DEFECT = 1e-8


@arrays
def matrix_between(axes: Matrix, turned: Matrix) -> Matrix:
    """R_ij = e_i . e'_j (3, 3), for two bases given by their unit vectors, one in each row.

    R takes components in the turned basis to components in the first; as an operator, in
    components of either basis, it takes each e_i to e'_i.
    """
    return axes @ turned.T


@arrays
def tensor_in_world(R_wb: Matrix, A_b: Matrix) -> Matrix:
    """Components R A R^T (3, 3) in the world's axes of a tensor given in the body's.

    Raises:
      ValueError: R_wb is not a rotation; under traces the result is NaN then.
    """
    R_wb = check_rotation("R_wb", R_wb)
    return R_wb @ A_b @ R_wb.T


@arrays
def tensor_in_body(R_wb: Matrix, A_w: Matrix) -> Matrix:
    """Components R^T A R (3, 3) in the body's axes of a tensor given in the world's.

    Raises:
      ValueError: R_wb is not a rotation; under traces the result is NaN then.
    """
    R_wb = check_rotation("R_wb", R_wb)
    return R_wb.T @ A_w @ R_wb


@arrays
def orthonormalize(A: Matrix, iterations: int = 10) -> Matrix:
    """The rotation (3, 3) nearest to a matrix, its polar factor; NaN unless det A > 0.

    It is found by Newton's iteration X <- (s X + X^-T / s) / 2, with the inverse by cofactors and s
    such that both terms have the same size: 10 rounds suffice for any matrix that is not singular
    to rounding, 2 for one that has drifted off by less than 1e-4. This is preferred to
    orthonormalising the rows one after the other, which depends on their order, and to singular
    values, which need LAPACK.

    Reference: Higham (1986), Computing the polar decomposition.
    """
    X = nan_unless(_inverse_transpose(A)[1] > 0, A)
    for _ in range(iterations):
        Y, _ = _inverse_transpose(X)
        s = jnp.sqrt(jnp.sqrt(jnp.sum(Y * Y) / jnp.sum(X * X)))
        X = (s * X + Y / s) / 2
    return X


@arrays
def check_rotation(name: str, R: Matrix) -> Matrix:
    """R, checked to be a rotation: orthogonal, with determinant 1.

    Raises:
      ValueError: R is not a rotation; if it is traced, the result is NaN instead.
    """
    off = _off_rotation(R)
    if _checks.is_traced(R):
        return nan_unless(off <= _MAX_ORTHOGONALITY_DEFECT, R)
    off = float(off)
    if off > _MAX_ORTHOGONALITY_DEFECT:
        raise _checks.fail(
            name,
            "a rotation: orthogonal columns of length 1, determinant 1",
            f"{np.asarray(R).tolist()}, off by {off:.2g}",
            "frames.orthonormalize finds the nearest rotation to a matrix that is nearly one.",
        )
    return R


@jax.jit  # or each operation would be compiled by itself at its first call
def _off_rotation(R: Matrix) -> Array:
    """How far a matrix is from a rotation ()."""
    columns = R.T @ R - jnp.eye(3)
    return jnp.maximum(jnp.max(jnp.abs(columns)), jnp.abs(dot(R[0], cross(R[1], R[2])) - 1))


def _inverse_transpose(X: Matrix) -> tuple[Matrix, Array]:
    cofactors = jnp.stack([cross(X[1], X[2]), cross(X[2], X[0]), cross(X[0], X[1])])
    det = dot(X[0], cofactors[0])
    return cofactors / det, det


#: Renamed in version 0.3.
_RENAMED = {"orthonormalise": "orthonormalize"}
__getattr__ = _doors.attribute_getter(__name__, renamed=_RENAMED)
