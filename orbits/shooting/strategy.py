"""How `orbits.find` looks for an orbit: a value of one type, passed as `strategy`.

Each kind is a class in a file of its own, with what it needs as fields: `Shooting`, `Descent`,
`Deflated`, `Collocation`, and `Automatic`, the default, which tries one of them and, where that
fails and the guess is stiff, collocation.
"""

import abc
import dataclasses

import numpy as np

from jaxdyn._checks import fail
from orbits.closing.given import Problem
from orbits.orbit import Orbit
from orbits.shooting.effort import Effort
from orbits.shooting.equations import Equations

_EXAMPLES = "one of orbits.Shooting(), Descent(), Deflated(known), Collocation()"


@dataclasses.dataclass(frozen=True)
class Search:
    """What is sought.

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
            driven=equations.driven,
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
