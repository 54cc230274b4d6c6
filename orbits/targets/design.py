"""Parameters of a scene for which an orbit, or a special point, meets a requirement.

`design` applies the Gauss-Newton method to the residuals of the requirement, with derivatives by
the implicit function theorem. In each step the orbit, or the point, is found again from the
prediction of its derivatives, so it is followed, however far the parameters move.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, _text
from jaxdyn._checks import array, fail, positive, whole
from jaxdyn.continuation import Equilibrium
from jaxdyn.continuation import sensitivity as points
from jaxdyn.status import Code
from orbits.analysis.sensitivity import DifferentiableOrbit, differentiable
from orbits.closing.closings import Hold
from orbits.orbit import Orbit, SearchError
from orbits.shooting.finding import find

#: The search ends if the next step is shorter, relative to the units of the parameters.
_SETTLED = 1e-12
#: How often a step is halved before the search gives up.
_HALVINGS = 12
#: Smallest decrease of the sum of squares, relative to it, with which a step is accepted.
_LESS = 1e-12
#: The search ends if the next step would change the residual by a smaller part of it.
_LEVEL = 1e-9


class DesignOutcome(Code):
    """How a search for a design ended."""

    FOUND = 0, "The requirement is met."
    LEAST = (
        1,
        "The requirement cannot be met near here: these numbers come closest to it. Free more of "
        "them, widen their bounds, or start elsewhere.",
    )
    LOST = (
        2,
        "No step keeps the orbit, or the point, and comes closer to the requirement: it may end in "
        "a fold on the way. Start elsewhere, or require less.",
    )
    STEP_LIMIT = 3, "The search reached its step limit. Continue from here, or increase steps."


@dataclasses.dataclass(frozen=True)
class Design:
    """Parameters of a scene, with the orbit or the special point that belongs to them.

    Attributes:
      numbers: (n,) the parameters.
      found: the orbit, or the special point.
      residual: (m,) residuals of the requirement, 0 if it is met.
      slopes: (m, n) their derivatives with respect to the parameters.
      steps: number of steps taken.
      outcome: how the search ended.
    """

    numbers: np.ndarray
    found: Orbit | Equilibrium
    residual: np.ndarray
    slopes: np.ndarray
    steps: int
    outcome: DesignOutcome

    @property
    def ok(self) -> bool:
        """Whether the requirement is met."""
        return self.outcome == DesignOutcome.FOUND

    @property
    def message(self) -> str:
        """How the search ended, in words."""
        return self.outcome.message

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [
            ("numbers", _text.brief(self.numbers)),
            ("residual", _text.brief(self.residual)),
            ("steps", str(self.steps)),
            ("outcome", f"{self.outcome.name}: {self.message}"),
        ]
        return _text.table("Design", rows)

    _repr_html_ = _text.html


def design(
    make: Callable[[Array], Any],
    wanted: Callable[[Any], Any],
    guess,
    near: Orbit | Equilibrium,
    *,
    lower=None,
    upper=None,
    hold: Hold = (),
    goal: float = 1e-10,
    steps: int = 50,
    throw: bool = True,
) -> Design:
    """Parameters of a scene for which an orbit, or a special point, meets a requirement.

    Args:
      make: numbers (n,) -> scene; if `near` is a special point of a family of equilibria, numbers
        (n,) -> (parameter -> scene). A program is compiled for each rate, so define that of an
        `ode` outside.
      wanted: the requirement as a function that returns residuals, a number or numbers (m,), which
        are 0 if it is met. Its argument is the `orbits.differentiable` orbit, with its period,
        start, multipliers and amplitudes, or the `jaxdyn.continuation.differentiable` point.
      guess: (n,) the parameters to which `near` belongs.
      near: the result of `find` for them; or a fold or a Hopf point, from ``family.special`` of
        `jaxdyn.continue_equilibria`.
      lower: (n,) lower bounds of the parameters; -inf for none.
      upper: (n,) upper bounds.
      hold: conditions on the orbit, as for `find`; they select a member of a family.
      goal: largest residual at which the requirement is met.
      steps: largest number of steps.
      throw: raise unless it is met; with False check `Design.outcome`.
    Returns:
      The parameters, and the orbit or the point. With more residuals than parameters, or if they
      cannot all be 0, those with the least sum of squares.
    Raises:
      ValueError: `near` is not an orbit that was found, nor such a point; shapes do not fit, or
        `guess` is not within its bounds.
      SearchError: the requirement is not met (``throw=True``).
    Limits: host only; a local search: elsewhere the sum of squares may be smaller.
    Example:
      >>> import jax.numpy as jnp, orbits
      >>> from jaxdyn import scenes
      >>> def make(numbers):  # the length of a pendulum of period 2 s that swings by 1 rad
      ...     return scenes.pendulum(length=numbers[0], angle=1.0)
      >>> swing = orbits.find(make(jnp.array([1.0])), period=2.2, hold="theta")
      >>> found = orbits.targets.design(
      ...     make, lambda orbit: orbit.period - 2.0, [1.0], swing, hold="theta"
      ... )
      >>> round(float(found.numbers[0]), 9), round(found.found.period, 9)
      (0.874143129, 2.0)
    """
    numbers = np.asarray(array("guess", guess, (None,)))
    low, high = _bounds(lower, upper, numbers)
    steps = whole("steps", steps)
    positive("goal", goal)
    problem = _of_orbits(make, near, hold) if isinstance(near, Orbit) else _of_points(make, near)
    search = _Search(problem, wanted, low, high, goal)
    found = search.run(numbers, near, steps)
    if throw and not found.ok:
        raise SearchError(found.message)
    return found


@dataclasses.dataclass(frozen=True)
class _Problem:
    """The object that is followed, an orbit or a special point, as a function of the parameters.

    Attributes:
      near: (numbers, known) -> the differentiable object.
      again: (numbers, known, guess of the object) -> the object found for other parameters.
      place: the numbers of the differentiable object that predict the next one.
    """

    near: Callable[[Array, Any], Any]
    again: Callable[[np.ndarray, Any, Any], Any]
    place: Callable[[Any], Any]


def _of_orbits(make: Callable[[Array], Scene], near: Orbit, hold: Hold) -> _Problem:
    if not near.ok:
        raise fail("near", "an orbit that closes", near.message, "find() one first.")

    def again(numbers: np.ndarray, known: Orbit, guess: Any) -> Orbit:
        y0, period = guess
        scene = make(jnp.asarray(numbers))
        return find(
            scene, y0, period, closing=known.closing, hold=hold, rtol=known.rtol, throw=True
        )

    def place(orbit: DifferentiableOrbit) -> tuple[Array, Array]:
        return orbit.y0, orbit.period

    return _Problem(lambda x, known: differentiable(make(x), known, hold=hold), again, place)


def _of_points(make: Callable[[Array], Any], near: Equilibrium) -> _Problem:
    if not isinstance(near, Equilibrium):
        expected = "an orbit, or a fold or a Hopf point"
        raise fail("near", expected, type(near).__name__, "See family.special.")

    def again(numbers: np.ndarray, known: Equilibrium, guess: Any) -> Equilibrium:
        state, parameter = guess
        here = make(jnp.asarray(numbers))
        return points.find_again(here, known, state, float(parameter))

    def place(point: points.DifferentiablePoint) -> tuple[Array, Array]:
        return point.state, point.parameter

    return _Problem(lambda x, known: points.differentiable(make(x), known), again, place)


@dataclasses.dataclass(frozen=True)
class _At:
    """The state of the search at some parameters."""

    numbers: np.ndarray
    found: Any
    residual: np.ndarray
    slopes: np.ndarray
    place: Any
    place_slopes: Any

    def sum_of_squares(self) -> float:
        return float(self.residual @ self.residual)


@dataclasses.dataclass(frozen=True)
class _Search:
    """The Gauss-Newton method with bounds; steps are halved until they come closer."""

    problem: _Problem
    wanted: Callable[[Any], Any]
    low: np.ndarray
    high: np.ndarray
    goal: float

    def run(self, numbers: np.ndarray, near: Any, steps: int) -> Design:
        here = self._at(numbers, near)
        for n in range(steps):
            if np.abs(here.residual).max() <= self.goal:
                return self._design(here, n, DesignOutcome.FOUND)
            step = self._step(here)
            if step is None:
                return self._design(here, n, DesignOutcome.LEAST)
            new = self._closer(here, step)
            if new is None:
                return self._design(here, n, DesignOutcome.LOST)
            here = new
        held = np.abs(here.residual).max() <= self.goal
        outcome = DesignOutcome.FOUND if held else DesignOutcome.STEP_LIMIT
        return self._design(here, steps, outcome)

    def _at(self, numbers: np.ndarray, found: Any) -> _At:
        def all_of(x: Array) -> tuple[Array, Any]:
            thing = self.problem.near(x, found)
            residual = jnp.atleast_1d(jnp.asarray(self.wanted(thing), float))
            return residual, self.problem.place(thing)

        residual, place = all_of(jnp.asarray(numbers))
        if residual.ndim != 1:
            raise fail("wanted", "a number or numbers (m,)", f"shape {residual.shape}")
        slopes, place_slopes = jax.jacfwd(all_of)(jnp.asarray(numbers))
        residual, slopes = np.asarray(residual), np.asarray(slopes)
        if not (np.isfinite(residual).all() and np.isfinite(slopes).all()):
            remedy = "A multiplier that meets another one has no derivative; see orbits.stability."
            raise fail("wanted", "finite numbers with derivatives", "NaN or infinite ones", remedy)
        return _At(numbers, found, residual, slopes, place, place_slopes)

    def _step(self, here: _At) -> np.ndarray | None:
        """(n,) the step within the bounds; None if none comes closer to first order."""
        units = np.where(here.numbers != 0, np.abs(here.numbers), 1.0)
        slopes, free = here.slopes * units, np.ones(len(units), bool)
        for _ in units:
            step = np.zeros(len(units))
            step[free] = -np.linalg.lstsq(slopes[:, free], here.residual)[0]
            new = here.numbers + step * units
            beyond = free & (
                ((new < self.low) & (here.numbers <= self.low))
                | ((new > self.high) & (here.numbers >= self.high))
            )
            if not beyond.any():
                break
            free &= ~beyond
        moved = np.clip(here.numbers + step * units, self.low, self.high) - here.numbers
        gained = np.abs(here.slopes @ moved).max()
        if gained <= _LEVEL * np.abs(here.residual).max() or np.abs(moved / units).max() < _SETTLED:
            return None
        return moved

    def _closer(self, here: _At, step: np.ndarray) -> _At | None:
        """The state after the step, or after a part of it that comes closer."""
        for _ in range(_HALVINGS):
            guess = jax.tree.map(
                lambda x, slope, step=step: np.asarray(x + slope @ step),
                here.place,
                here.place_slopes,
            )
            numbers = here.numbers + step
            try:
                new = self._at(numbers, self.problem.again(numbers, here.found, guess))
            except (SearchError, ValueError):
                new = None
            if new is not None:
                before, after = here.sum_of_squares(), new.sum_of_squares()
                if after < (1 - _LESS) * before or np.abs(new.residual).max() <= self.goal:
                    return new
            step = 0.5 * step
        return None

    @staticmethod
    def _design(here: _At, steps: int, outcome: DesignOutcome) -> Design:
        return Design(here.numbers, here.found, here.residual, here.slopes, steps, outcome)


def _bounds(lower, upper, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low, high = (
        np.full(len(numbers), end)
        if given is None
        else np.broadcast_to(np.asarray(given, float), numbers.shape)
        for given, end in ((lower, -np.inf), (upper, np.inf))
    )
    if not ((low <= numbers) & (numbers <= high)).all():
        raise fail("guess", "within its bounds", numbers.tolist(), "See lower and upper.")
    return low, high
