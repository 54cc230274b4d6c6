"""Forces on coordinates that are linear in all of them, by constant matrices."""

from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn.scene import Effect


class MatrixDamper(Effect):
    """The forces -C dq/dt on the coordinates q of a system, e.g. of `scenes.linear_system`.

    The symmetric part of C damps; the skew-symmetric part gives gyroscopic forces, without power.

    Attributes:
      C: (n, n) matrix of damping and gyroscopic forces.
    """

    C: Array = eqx.field(converter=as_float)

    def generalized(self, t, q, v):
        del t, q
        return -self.C @ v

    def check(self, points):
        del points
        _checks.finite("C", self.C)


class CirculatoryForce(Effect):
    """The forces -N q on the coordinates q of a system, without a potential: N is skew-symmetric.

    Such forces arise in oil films, by friction and in air flow, and may cause flutter.

    Attributes:
      N: (n, n) matrix of circulatory forces.
    """

    N: Array = eqx.field(converter=as_float)
    velocity_dependent: ClassVar[bool] = False

    def generalized(self, t, q, v):
        del t, v
        return -self.N @ q

    def check(self, points):
        del points
        _checks.finite("N", self.N)
