"""How accurately, and for how long, an orbit is sought."""

import dataclasses
from collections.abc import Callable

from jaxdyn._checks import positive, whole
from jaxdyn.integrate.spans import tolerances
from orbits.shooting.newton import Iteration

RTOL = 1e-14
GOAL = 1e-12
#: The tightest useful tolerance, for second opinions: below it rounding dominates.
TIGHT = 1e-15


@dataclasses.dataclass(frozen=True)
class Effort:
    """Accuracy and iteration limit of a search; see `find`."""

    goal: float
    rtol: float
    max_iterations: int
    report: Callable[[Iteration], None]

    def check(self) -> None:
        """Raise ValueError unless goal > 0, 0 < rtol < 1 and max_iterations >= 0."""
        positive("goal", self.goal, "It is the largest closing error of an orbit.")
        tolerances(self.rtol, None)  # jitted code cannot raise
        whole("max_iterations", self.max_iterations, least=0)
