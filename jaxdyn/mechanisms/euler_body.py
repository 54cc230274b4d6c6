"""A rigid body in Euler angles: a mechanism for `NewtonEuler` or `Lagrange`.

It does not use Euler's equations, so it is a second route to the motions of `rigid.RigidBody`. The
angles lock in some poses.
"""

import functools
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.formulations.mechanism import Mechanism
from jaxdyn.formulations.rigid import (
    METRES,
    FirstPoint,
    Pose,
    about_centre,
    at_pivot,
    check_matter,
    rotate,
)
from jaxdyn.geometry.euler import (
    SEQUENCES,
    euler_from_matrix,
    euler_rates_from_body,
    matrix_from_euler,
    omega_b_from_euler,
)
from jaxdyn.geometry.frames import check_rotation
from jaxdyn.geometry.inertia import MaterialPoints
from jaxdyn.joints import body
from jaxdyn.sketch import Looks


class EulerBody(Mechanism):
    """A rigid body in Euler angles: q = [r, angles], or the angles alone about a pivot.

    Attributes:
      matter: its material points in its own axes, whose origin is the pivot if it has one.
      sequence: one of `euler.SEQUENCES`, e.g. "ZXZ"; choose one that does not lock.
      pivoted: whether the origin of its axes is fixed at the world's origin.
      drawn: function from the positions (p, 3) of its points, in its own axes, to what a drawing
        shows; defined in a module, since each lambda compiles again. By default the path of
        the first point is drawn.
    """

    matter: MaterialPoints
    sequence: str = eqx.field(static=True)
    pivoted: bool = eqx.field(static=True)
    drawn: Looks
    massless: ClassVar[bool] = True
    singular: ClassVar[str] = (
        "Euler angles lock where their first and third axes are parallel: take another sequence, "
        "or representation='quaternion'."
    )

    def __init__(
        self,
        matter: MaterialPoints,
        sequence: str = "ZXZ",
        *,
        pivoted: bool = False,
        drawn: Looks | None = None,
    ):
        self.matter = matter if pivoted else about_centre(matter)
        self.sequence = sequence
        self.pivoted = pivoted
        self.drawn = FirstPoint() if drawn is None else drawn

    def coordinates(self):
        angles = (("phi", "rad"), ("theta", "rad"), ("psi", "rad"))
        return angles if self.pivoted else (*METRES, *angles)

    def masses(self):
        return self.matter.m

    def central(self):
        return 0 if self.pivoted else 3

    def positions(self, t, q):
        del t
        r, angles = self._parts(q)
        return r[None] + rotate(matrix_from_euler(angles, self.sequence), self.matter.r)

    def sketch(self, t, q):
        del t
        r, angles = self._parts(q)
        R = matrix_from_euler(angles, self.sequence)
        return tuple(shape.place(r, R) for shape in self.drawn(self.matter.r))

    def bodies(self, t, q):
        del t, q
        return body("body", self.matter.m)

    def joints(self, t, q):
        del t, q
        return at_pivot(self.pivoted)

    def pose(self, q: Array, v: Array) -> Pose:
        """The position, attitude and angular velocity for coordinates and velocities (n,)."""
        r, angles = self._parts(q)
        velocity, rates = self._parts(v)
        omega_b = rotate(omega_b_from_euler(angles, self.sequence), rates)
        return Pose(r=r, R_wb=matrix_from_euler(angles, self.sequence), v=velocity, omega_b=omega_b)

    def state(self, pose: Pose) -> Array:
        """(2 n,) the coordinates and velocities in a given pose.

        Raises:
          ValueError: the angles lock in this pose; if it is traced, the rates are NaN.
        """
        R_wb = check_rotation("R_wb", pose.R_wb)
        angles, rates = _angles_and_rates(R_wb, pose.omega_b, self.sequence)
        locked = not _checks.is_traced((rates, pose)) and bool(np.isnan(rates).any())
        if locked and bool(np.isfinite(pose.omega_b).all()):
            raise _checks.fail(
                "sequence",
                "Euler angles that do not lock in the pose at the start",
                repr(self.sequence),
                "Take another sequence (the second angle of XYZ locks at pi/2, that of ZXZ at 0), "
                "or a quaternion.",
            )
        if self.pivoted:
            return jnp.concatenate([angles, rates])
        return jnp.concatenate([pose.r, angles, pose.v, rates])

    def check(self):
        _checks.choice("sequence", self.sequence, SEQUENCES)
        check_matter(self.matter, self.pivoted)

    def _parts(self, q: Array) -> tuple[Array, Array]:
        return (jnp.zeros(3), q) if self.pivoted else (q[:3], q[3:])


@functools.partial(jax.jit, static_argnames="sequence")  # one program, not one for each operation
def _angles_and_rates(R_wb: Array, omega_b: Array, sequence: str) -> tuple[Array, Array]:
    """(3,) the angles, and (3,) their rates."""
    angles = euler_from_matrix(R_wb, sequence).angles
    return angles, euler_rates_from_body(angles, omega_b, sequence).rates
