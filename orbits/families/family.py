"""What a family of periodic orbits is: its members, and what is special between them."""

import dataclasses
import enum

import numpy as np

from orbits.analysis.stability import Stability
from orbits.families.surface import Point
from orbits.orbit import Orbit
from orbits.shooting.equations import Equations


class Kind(enum.StrEnum):
    """What is special about a member of a family."""

    FOLD = "fold"
    BRANCH = "branch point"
    DOUBLING = "period doubling"
    TORUS = "torus point"


@dataclasses.dataclass(frozen=True)
class Member:
    """One orbit of a family.

    Attributes:
      orbit: the orbit.
      parameter: the number the family is named after; NaN where there is none.
      energy: of the scene at the start; NaN where it has none.
      stability: multipliers and verdict.
      point: where it lies on the surface of solutions.
      tangent: unit vector along the family there.
      kind: what is special about it, if anything.
    """

    orbit: Orbit
    parameter: float
    energy: float
    stability: Stability
    point: Point
    tangent: np.ndarray
    kind: Kind | None = None


@dataclasses.dataclass(frozen=True)
class Family:
    """Orbits in the order in which they were passed.

    Attributes:
      members: the orbits, one a step.
      special: folds, branch points, period doublings and torus points, between members.
      end: why it ends where it does.
      equations: the closing equations they solve.
    """

    members: tuple[Member, ...]
    special: tuple[Member, ...]
    end: str
    equations: Equations

    @property
    def parameters(self) -> np.ndarray:
        """(n,) of the members."""
        return np.array([member.parameter for member in self.members])

    @property
    def periods(self) -> np.ndarray:
        """(n,) of the members [time of the scene]."""
        return np.array([member.orbit.period for member in self.members])

    @property
    def energies(self) -> np.ndarray:
        """(n,) of the members."""
        return np.array([member.energy for member in self.members])
