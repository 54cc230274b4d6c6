"""How accurately, and for how long, an orbit is sought."""

import dataclasses
import math
from collections.abc import Callable

from jaxdyn._checks import fail, positive, whole
from jaxdyn._progress import report_progress
from jaxdyn.accuracy.timing import Clock
from jaxdyn.integrate.spans import tolerances
from orbits.shooting.newton import Iteration
from orbits.shooting.segment import MAX_STEPS, Limits

RTOL = 1e-14
GOAL = 1e-12
#: The tightest useful tolerance, for second opinions: below it rounding dominates.
TIGHT = 1e-15
SECONDS = 600.0  # default time limit of a search, for all that it tries


@dataclasses.dataclass(frozen=True)
class Effort:
    """Accuracy and limits of a search that begins now, and what it has tried; see `find`."""

    goal: float
    rtol: float
    max_iterations: int
    report: Callable[[Iteration], None]
    seconds: float = math.inf
    clock: Clock = dataclasses.field(default_factory=Clock)
    tried: list[str] = dataclasses.field(default_factory=list)

    def begin(self, what: str) -> None:
        """Report what is tried next, e.g. "a descent"."""
        self.tried.append(what)
        report_progress(f"searching by {what}")

    @property
    def over(self) -> bool:
        """Whether the time is up.

        This is asked between integrations, which are not interrupted. Compiling does not count.
        """
        return self.clock.seconds - self.clock.compiling > self.seconds

    def limits(self, max_steps: int = MAX_STEPS) -> Limits:
        """The limits of the evaluations that it pays for."""
        return Limits(max_steps, lambda: self.over)

    def share(self, part: float) -> "Effort":
        """The same effort, limited to a part of the time that is left."""
        took = self.clock.seconds - self.clock.compiling
        return dataclasses.replace(self, seconds=took + part * (self.seconds - took))

    def __str__(self) -> str:
        """What was tried, and for how long."""
        compiling = self.clock.compiling
        took = f"{self.clock.seconds - compiling:.3g} s, and {compiling:.3g} s of compiling"
        return f"Tried: {'; '.join(self.tried)}. In {took}."

    def check(self) -> None:
        """Raise ValueError unless goal, seconds > 0, 0 < rtol < 1 and max_iterations >= 0."""
        positive("goal", self.goal, "It is the largest closing error of an orbit.")
        if not self.seconds > 0:
            raise fail("seconds", "> 0", self.seconds, "It limits the time of the search.")
        tolerances(self.rtol, None)  # jitted code cannot raise
        whole("max_iterations", self.max_iterations, least=0)
