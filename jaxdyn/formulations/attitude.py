"""The orientation of a body in its state: a quaternion or a matrix.

Neither of them is singular in any pose; in return their entries satisfy constraints (unit length,
orthogonal columns). Steps preserve these to the tolerance, the projection after each step to
rounding.
"""

import abc

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.geometry.frames import orthonormalize
from jaxdyn.geometry.rotations import (
    matrix_from_wxyz,
    normalize_wxyz,
    wxyz_from_matrix,
    wxyz_rate_from_body,
)
from jaxdyn.geometry.vectors import skew
from jaxdyn.system import Record

_NEWTON_STEPS = 2  # steps of `orthonormalize`, for a matrix that has drifted for one step


class Attitude(Record):
    """A representation of orientation by n numbers a (n,)."""

    @abc.abstractmethod
    def labels(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of the n numbers."""

    @abc.abstractmethod
    def matrix(self, a: Array) -> Array:
        """The matrix R_wb (3, 3)."""

    @abc.abstractmethod
    def of(self, R_wb: Array) -> Array:
        """The numbers (n,) of a rotation matrix (3, 3)."""

    @abc.abstractmethod
    def rate(self, a: Array, omega_b: Array) -> Array:
        """The rates (n,) of the numbers at an angular velocity (3,)."""

    @abc.abstractmethod
    def nearest(self, a: Array) -> Array:
        """The nearest n numbers (n,) that represent a rotation."""

    def align(self, a: Array, like: Array) -> Array:
        """The representation closest to another, of all those of the same rotation."""
        del like
        return a


class Quaternion(Attitude):
    """A unit quaternion wxyz; q and -q are one rotation."""

    def labels(self):
        return tuple((name, "1") for name in ("qw", "qx", "qy", "qz"))

    def matrix(self, a):
        return matrix_from_wxyz(a)

    def of(self, R_wb):
        return wxyz_from_matrix(R_wb)

    def rate(self, a, omega_b):
        return wxyz_rate_from_body(a, omega_b)

    def nearest(self, a):
        return normalize_wxyz(a)

    def align(self, a, like):
        return jnp.where(jnp.sum(a * like) < 0, -a, a)


class RotationMatrix(Attitude):
    """The nine entries of R_wb, row by row."""

    def labels(self):
        return tuple((f"R{i}{j}", "1") for i in (1, 2, 3) for j in (1, 2, 3))

    def matrix(self, a):
        return a.reshape(3, 3)

    def of(self, R_wb):
        return R_wb.ravel()

    def rate(self, a, omega_b):
        # This is a sum, not a matrix product, for the reason given at mechanism.weighted_gram.
        return jnp.sum(a.reshape(3, 3, 1) * skew(omega_b)[None, :, :], axis=1).ravel()

    def nearest(self, a):
        return orthonormalize(a.reshape(3, 3), _NEWTON_STEPS).ravel()
