"""The content of a page: numbers, checks, pictures and motions, in the order of their creation."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxdyn import _text, player
from jaxdyn.integrate.events import Event
from jaxdyn.scene import Scene


class Number(NamedTuple):
    """A number or a short list of them, with a name and a unit (empty if it has none)."""

    name: str
    value: Any
    unit: str


class Check(NamedTuple):
    """A statement, the figure behind it, and whether it holds.

    Attributes:
      statement: the statement that is checked.
      route: how else it is known: "closed form", "printed number", "second formulation".
      holds: whether it holds.
      error: largest difference from the expected value; NaN if the statement is not an equation.
      within: largest difference allowed; NaN if the statement is not an equation.
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
    """A picture with its caption.

    Attributes:
      make: makes the Matplotlib figure.
      look: the caption, one sentence.
    """

    make: Callable[[], Any]
    look: str

    @property
    def figure(self) -> Any:
        """The Matplotlib figure, which is made now."""
        return self.make()


class PlayedMotions(NamedTuple):
    """Motions for a browser, by name, shown together or selected by a slider.

    Attributes:
      motions: trajectories by name.
      look: the caption, one sentence.
      choose: the parameter that the slider changes, with its unit; empty to show all together.
      inexact: whether the motions are shown because of their errors.
      ends: an event that ends each motion where it runs, such as landing; or None.
    """

    motions: Mapping[str, Any]
    look: str
    choose: str = ""
    inexact: bool = False
    ends: Event | None = None


class Page:
    """The content of a page, which its ``solve(page)`` fills.

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
        self.played: list[PlayedMotions] = []
        self.asks: list[player.Ask] = []

    @property
    def holds(self) -> bool:
        """Whether there are checks and all of them hold."""
        return bool(self.checks) and all(check.holds for check in self.checks)

    def __getitem__(self, name: str) -> Any:
        """The value of the number with this name."""
        return {number.name: number.value for number in self.numbers}[name]

    def number(self, name: str, value: Any, unit: str = "") -> None:
        """Add a value to the table: a number (), several (n,), or a short text."""
        self.numbers.append(Number(name, value if isinstance(value, str) else _host(value), unit))

    def equal(
        self, statement: str, got: Any, expected: Any, *, within: float, route: str = "closed form"
    ) -> None:
        """Check that two arrays of equal shape differ by at most `within`, an absolute error.

        Raises:
          ValueError: their shapes differ, which broadcasting would hide.
        """
        got, expected = _host(got), _host(expected)
        if got.shape != expected.shape:
            raise _text.fail("expected", f"the shape of what was got, {got.shape}", expected.shape)
        error = float(np.max(np.abs(got - expected)))
        self.checks.append(Check(statement, route, bool(error <= within), error, within))

    def true(self, statement: str, holds: Any, *, route: str) -> None:
        """Check a statement that is not an equation, such as a verdict or a count."""
        self.checks.append(Check(statement, route, bool(holds)))

    def draw(self, make: Callable[[], Any], look: str) -> None:
        """Add a picture, which is made only where it is shown.

        Args:
          make: a function without arguments that returns a Matplotlib figure, such as the result of
            a function of `drawing`.
          look: the caption.
        """
        self.drawings.append(Drawing(make, look))

    def play(
        self,
        motions: Any,
        look: str,
        *,
        choose: str = "",
        inexact: bool = False,
        ends: Event | None = None,
    ) -> None:
        """Add a motion, or several by name, for a browser, as a running scene if possible.

        Args:
          motions: the result of `simulate` or `simulate_phases`, or a mapping of names to such.
          look: the caption.
          choose: the parameter, with its unit, whose values are the names: a slider then selects
            one of the motions. By default they are shown together.
          inexact: whether the motions are shown because of their errors: they are played as they
            were computed.
          ends: an event that ends each motion where it runs, such as landing. By default a motion
            continues after its span.
        """
        named = motions if isinstance(motions, Mapping) else {"": motions}
        self.played.append(
            PlayedMotions(
                {str(name): one for name, one in named.items()}, look, choose, inexact, ends
            )
        )

    def ask(
        self, question: str, answer: str, scenes: Scene | Mapping[str, Scene] | None = None
    ) -> None:
        """Add a question beside the first motion that runs, with its answer folded.

        Args:
          question: such as "What happens when it starts upright?"
          answer: the answer; its figures are those of this page.
          scenes: the scene of the motion with the initial state and parameters that show it, or
            several by name, perhaps without some effects; None if the motion shows it as it is.
        """
        self.asks.append(player.Ask(question, answer, scenes))


def _host(value: Any) -> np.ndarray:
    return np.asarray(value)
