"""The content of a page: numbers, checks, pictures and motions, in the order in which they came."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxdyn import _text
from jaxdyn.player import Ask
from jaxdyn.scene import Scene


class Number(NamedTuple):
    """A number or a short list of them, with a name and a unit (empty if it has none)."""

    name: str
    value: Any
    unit: str


class Check(NamedTuple):
    """A statement, the figure behind it, and whether it holds.

    Attributes:
      statement: what should hold.
      route: how else it is known: "closed form", "printed number", "second formulation".
      holds: whether it does.
      error: largest difference from what was expected; NaN where the statement is no equation.
      within: the largest difference allowed; NaN where the statement is no equation.
    """

    statement: str
    route: str
    holds: bool
    error: float = math.nan
    within: float = math.nan

    @property
    def figure(self) -> str:
        """The figure behind it, as text; empty if there is none."""
        return "" if math.isnan(self.within) else f"{self.error:.1e} <= {self.within:.0e}"


class Drawing(NamedTuple):
    """A Matplotlib figure, and a sentence that says what to see in it."""

    figure: Any
    look: str


class Played(NamedTuple):
    """Motions for a browser, by name: shown together, or one of them chosen by a slider.

    Attributes:
      motions: trajectories by name.
      look: a sentence that says what to see.
      choose: the parameter that the slider changes, with its unit; empty to show all together.
      inexact: whether the errors of the motions are what there is to see.
    """

    motions: Mapping[str, Any]
    look: str
    choose: str = ""
    inexact: bool = False


class Page:
    """What a page shows; a page's ``solve(page)`` fills it.

    Example:
      >>> page = Page()
      >>> page.number("area of the unit circle", math.pi, "m^2")
      >>> page.equal("sin^2 + cos^2 = 1", math.sin(1) ** 2 + math.cos(1) ** 2, 1.0, within=1e-15)
      >>> page.holds
      True
    """

    def __init__(self) -> None:
        self.numbers: list[Number] = []
        self.checks: list[Check] = []
        self.drawings: list[Drawing] = []
        self.played: list[Played] = []
        self.asks: list[Ask] = []

    @property
    def holds(self) -> bool:
        """Whether there are checks and all of them hold."""
        return bool(self.checks) and all(check.holds for check in self.checks)

    def __getitem__(self, name: str) -> Any:
        """The value of the number of a name."""
        return {number.name: number.value for number in self.numbers}[name]

    def number(self, name: str, value: Any, unit: str = "") -> None:
        """Add a number to the table: () or (n,), or a short text."""
        self.numbers.append(Number(name, value if isinstance(value, str) else _host(value), unit))

    def equal(
        self, statement: str, got: Any, expected: Any, *, within: float, route: str = "closed form"
    ) -> None:
        """Check that two arrays of one shape differ by at most `within`, an absolute error.

        Raises:
          ValueError: their shapes differ, which broadcasting would hide.
        """
        got, expected = _host(got), _host(expected)
        if got.shape != expected.shape:
            raise _text.fail("expected", f"the shape of what was got, {got.shape}", expected.shape)
        error = float(np.max(np.abs(got - expected)))
        self.checks.append(Check(statement, route, bool(error <= within), error, within))

    def true(self, statement: str, holds: Any, *, route: str) -> None:
        """Check a statement that is no equation, such as a verdict or a count."""
        self.checks.append(Check(statement, route, bool(holds)))

    def draw(self, figure: Any, look: str) -> None:
        """Add a picture (what the functions of `drawing` return), and what to see in it."""
        self.drawings.append(Drawing(figure, look))

    def play(self, motions: Any, look: str, *, choose: str = "", inexact: bool = False) -> None:
        """Add a motion, or several by name, for a browser: as a scene that runs if it can.

        Args:
          motions: what `simulate` or `simulate_phases` returned, or a mapping of names to them.
          look: what to see.
          choose: the parameter, with its unit, of which the names are values: a slider then
            chooses one of them. By default they are shown together.
          inexact: whether the errors of the motions are what there is to see: they are played as
            they were computed.
        """
        named = motions if isinstance(motions, Mapping) else {"": motions}
        self.played.append(
            Played({str(name): one for name, one in named.items()}, look, choose, inexact)
        )

    def ask(
        self, question: str, answer: str, scenes: Scene | Mapping[str, Scene] | None = None
    ) -> None:
        """Add a question that stands beside the first motion that runs, with its answer folded.

        Args:
          question: "What happens when it starts upright?"
          answer: what does; its figures are those of this page.
          scenes: that of the motion with the start and the numbers that show it, or several by
            name, perhaps without some effects; None where the motion shows it as it is.
        """
        self.asks.append(Ask(question, answer, scenes))


def _host(value: Any) -> np.ndarray:
    return np.asarray(value)
