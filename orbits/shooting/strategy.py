"""How `orbits.find` looks for an orbit: a value of one type, passed as `strategy`.

Each kind is a class, with what it needs as fields: `Shooting`, `Descent`, `Deflated`,
`Collocation`, and `Automatic`, the default, which tries one of them and, where that fails and the
guess is stiff, collocation. All of them have the accuracy and the limits of an `Effort`.
"""

import abc
import dataclasses
import math
from collections.abc import Callable

import numpy as np

from jaxdyn._checks import fail, positive, whole
from jaxdyn._progress import report_progress
from jaxdyn.accuracy.timing import Clock
from jaxdyn.integrate.spans import tolerances
from orbits.closing.given import Problem
from orbits.orbit import Orbit
from orbits.shooting.equations import Equations
from orbits.shooting.newton import Iteration
from orbits.shooting.segment import MAX_STEPS, Limits

# ---- How accurately, and for how long, an orbit is sought

RTOL = 1e-14
GOAL = 1e-12
#: The tightest useful tolerance, for second opinions: below it rounding dominates.
TIGHT = 1e-15
SECONDS = 600.0  # default time limit of a search, for all that it tries
#: Newton steps at most, by default: along a curved valley of the closing error they are short, and
#: a hundred and more may lead to an orbit near a rough guess.
ITERATIONS = 200


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
        return self.clock.computing > self.seconds

    def limits(self, max_steps: int = MAX_STEPS) -> Limits:
        """The limits of evaluations within this effort."""
        return Limits(max_steps, lambda: self.over)

    def share(self, part: float) -> "Effort":
        """The same effort, limited to a part of the time that is left."""
        took = self.clock.computing
        return dataclasses.replace(self, seconds=took + part * (self.seconds - took))

    def __str__(self) -> str:
        """What was tried, and for how long."""
        took = f"{self.clock.computing:.3g} s, and {self.clock.compiling:.3g} s of compiling"
        return f"Tried: {'; '.join(self.tried)}. In {took}."

    def check(self) -> None:
        """Raise ValueError for limits out of range, or a tolerance that `simulate` refuses."""
        positive("goal", self.goal, "It is the largest residual of an orbit.")
        if not self.seconds > 0:
            raise fail("seconds", "> 0", self.seconds, "It limits the time of the search.")
        tolerances(self.rtol, None)  # jitted code cannot raise
        whole("max_iterations", self.max_iterations, least=0)


# ---- The strategies

_EXAMPLES = "one of orbits.Shooting(), Descent(), Deflated(known), Collocation()"


@dataclasses.dataclass(frozen=True)
class Search:
    """A search for an orbit, which a strategy carries out.

    Attributes:
      problem: the guess, and bounds on the start and the period.
      equations: the closing equations, in one segment.
      angle: () guess of the angle of a relative orbit.
      segments: number of segments; None for as many as the growth of errors requires.
      effort: accuracy and limits.
    """

    problem: Problem
    equations: Equations
    angle: float
    segments: int | None
    effort: Effort

    def at(self, equations: Equations, x: np.ndarray) -> "Search":
        """The same search from a guess x, the unknowns of `equations` in any number of segments."""
        unknowns = equations.unpack(x)
        scene = self.problem.scene.starting(equations.start_at(x), unknowns.period)
        whole = Equations(
            scene=scene,
            closing=equations.closing,
            conditions=equations.conditions,
            beside=equations.beside,
        )
        return dataclasses.replace(
            self,
            problem=dataclasses.replace(self.problem, scene=scene),
            equations=whole,
            angle=float(unknowns.angle),
        )


class Strategy(abc.ABC):
    """A way to look for a periodic orbit; a new one is a subclass."""

    @abc.abstractmethod
    def orbit(self, search: Search) -> Orbit:
        """The orbit, or the best iterate and the reason."""


def check_strategy(strategy: object) -> None:
    """Raise ValueError for what is not a strategy, such as a class that was not called."""
    if not isinstance(strategy, Strategy):
        called = isinstance(strategy, type) and issubclass(strategy, Strategy)
        remedy = f"Call it: orbits.{strategy.__name__}(...)." if called else ""
        raise fail("strategy", _EXAMPLES, strategy.__name__ if called else repr(strategy), remedy)
