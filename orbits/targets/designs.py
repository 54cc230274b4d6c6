"""Parameters of a scene for which an orbit, or a special point, meets a requirement.

`design` applies the Gauss-Newton method to the residuals of the requirement, with derivatives by
the implicit function theorem. In each step the orbit, or the point, is found again from the
prediction by its derivatives, so it is followed, however far the parameters move.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn._checks import array, check_callable, check_on_host, positive, whole
from jaxdyn.status import Code, Ended
from orbits.closing.closings import Hold
from orbits.orbit import SearchError
from orbits.shooting.strategy import SECONDS
from orbits.targets.followed import Asked, At, Near, Search, TimeLimit, bounds, follow, is_in_family

#: The search ends if the next step is shorter, relative to the units of the parameters.
_SETTLED = 1e-12
#: Smallest decrease of the sum of squares, relative to it, with which a step is accepted.
_LESS = 1e-12
#: The search ends if the next step would change the residual by a smaller part of it.
_LEVEL = 1e-9
#: Predicted relative decrease of the sum of squares below which nonlinear terms may hide it. A step
#: is then accepted if the next one would change the residuals less, by the second factor.
_HARDLY, _SHORTER = 1e-9, 0.7


_OF_FAMILY = (
    "The orbits of this scene come in families, with one for each energy, and nothing says which "
    "one is meant: pass hold=, the name of an entry of the start, or orbits.Energy(E)."
)


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
    TIME_LIMIT = 4, "The time is up. Continue from here, or increase seconds."


@dataclasses.dataclass(frozen=True)
class Design(Ended):
    """Parameters of a scene, with the orbit or the special point that belongs to them.

    Attributes:
      numbers: (n,) the parameters.
      found: the orbit, or the special point, or a tuple of them.
      residual: (m,) residuals of the requirement, 0 if it is met.
      slopes: (m, n) their derivatives with respect to the parameters.
      steps: number of steps taken.
      outcome: how the search ended.
      advice: a further possible cause of failure; "" if there is none.
    """

    numbers: np.ndarray
    found: Any
    residual: np.ndarray
    slopes: np.ndarray
    steps: int
    outcome: DesignOutcome
    advice: str = ""

    @property
    def message(self) -> str:
        """How the search ended, in words."""
        return " ".join(filter(None, [self.outcome.message, self.advice]))

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
    near: Near | Sequence[Near],
    *,
    lower=None,
    upper=None,
    hold: Hold = (),
    goal: float = 1e-10,
    steps: int = 50,
    seconds: float = SECONDS,
    throw: bool = True,
) -> Design:
    """Parameters of a scene for which an orbit, or a special point, meets a requirement.

    Args:
      make: numbers (n,) -> scene, or legs or phases for a chain of legs; if `near` is a special
        point of a family, numbers (n,) -> (parameter -> scene), except for families of orbits in
        energy. A program is compiled for each rate, so define that of an `ode` outside.
      wanted: the requirement as a function that returns residuals, a number or numbers (m,), which
        are 0 if it is met. Its argument is what `orbits.differentiable` returns: an orbit or a
        chain, with its period, start, multipliers and amplitudes; a special equilibrium, with its
        parameter; a special orbit with its parameter (its energy in a family in energy) and its
        `orbit`. For several of them it is a tuple.
      guess: (n,) the parameters to which `near` belongs.
      near: the result of `find` or `find_hybrid` for them; or a fold or a Hopf point, from
        ``family.special`` of `jaxdyn.continue_equilibria`; or a fold, branch point, period doubling
        or torus point, from ``family.special`` of `orbits.continue_family`; or a list of these, for
        instance the two ends of an interval of stable orbits.
      lower: (n,) lower bounds of the parameters; -inf for none.
      upper: (n,) upper bounds.
      hold: conditions on the orbit, as for `find`; they select a member of a family. The name of
        an entry stands for its value at the start of the scene, if `near` begins with that.
      goal: largest residual at which the requirement is met.
      steps: largest number of steps.
      seconds: time limit, without that of compiling; what is being computed then is completed.
      throw: raise unless it is met; with False check `Design.outcome`.
    Returns:
      The parameters, and the orbit or the point (for a special orbit, see
      `orbits.families.SpecialOrbit`). With more residuals than parameters, or if they
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
      >>> found = orbits.design(
      ...     make, lambda orbit: orbit.period - 2.0, [1.0], swing, hold="theta"
      ... )
      >>> round(float(found.numbers[0]), 9), round(found.found.period, 9)
      (0.874143129, 2.0)
    """
    check_on_host("design", guess, "Call it outside jit, grad and vmap.")
    numbers = np.asarray(array("guess", guess, (None,), "For one number write [10.0]."))
    low, high = bounds(lower, upper, numbers)
    steps = whole("steps", steps)
    positive("goal", goal)
    limit = TimeLimit(seconds)
    check_callable("make", make, "numbers")
    check_callable("wanted", wanted, "found")
    followed, known = follow(make, near, hold)
    search = _Search(followed, Asked("wanted", wanted), low, high, goal, limit)
    found = search.run(numbers, known, steps)
    if not found.ok and not hold and is_in_family(found.found):
        found = dataclasses.replace(found, advice=_OF_FAMILY)
    if throw and not found.ok:
        raise SearchError(found.message)
    return found


class _Search(Search):
    """The Gauss-Newton method; steps are halved until they come closer."""

    def run(self, numbers: np.ndarray, near: Any, steps: int) -> Design:
        here = self.followed.at(numbers, near, self.asked)
        for n in range(steps):
            if self._is_met(here):
                return self._design(here, n, DesignOutcome.FOUND)
            step = self._step(here)
            if step is None:
                return self._design(here, n, DesignOutcome.LEAST)
            new = self.shorten(here, step)
            if new is None:
                level = DesignOutcome.LEAST if _is_level(here, step) else DesignOutcome.LOST
                over = self.limit.over
                return self._design(here, n, DesignOutcome.TIME_LIMIT if over else level)
            here = new
        outcome = DesignOutcome.FOUND if self._is_met(here) else DesignOutcome.STEP_LIMIT
        return self._design(here, steps, outcome)

    def _step(self, here: At) -> np.ndarray | None:
        """(n,) the step within the bounds; None if none comes closer to first order."""
        units = here.units
        slopes, free = here.slopes * units, np.ones(len(units), bool)
        for _ in units:
            step = np.zeros(len(units))
            step[free] = -np.linalg.lstsq(slopes[:, free], here.value)[0]
            new = here.numbers + step * units
            beyond = free & (
                ((new < self.low) & (here.numbers <= self.low))
                | ((new > self.high) & (here.numbers >= self.high))
            )
            if not beyond.any():
                break
            free &= ~beyond
        moved = np.clip(here.numbers + step * units, self.low, self.high) - here.numbers
        gained = _gain(here, moved)
        if gained <= _LEVEL * np.abs(here.value).max() or np.abs(moved / units).max() < _SETTLED:
            return None
        return moved

    def accepts(self, here: At, new: At) -> bool:
        """Whether the sum of squares decreases or, where it is level, the next step is smaller.

        Near its minimum the sum of squares changes only to second order, and so does not show how
        far away the minimum is; the effect of the next step does.
        """
        before, after = (float(at.value @ at.value) for at in (here, new))
        if after < (1 - _LESS) * before or self._is_met(new):
            return True
        step, further = self._step(here), self._step(new)
        if step is None or not _is_level(here, step) or after > (1 + _LESS) * before:
            return False
        return further is None or _gain(new, further) < _SHORTER * _gain(here, step)

    def _is_met(self, here: At) -> bool:
        return bool(np.abs(here.value).max() <= self.goal)

    @staticmethod
    def _design(here: At, steps: int, outcome: DesignOutcome) -> Design:
        return Design(here.numbers, here.found, here.value, here.slopes, steps, outcome)


def _gain(here: At, step: np.ndarray) -> float:
    """The largest change of a residual by a step, to first order."""
    return float(np.abs(here.slopes @ step).max())


def _is_level(here: At, step: np.ndarray) -> bool:
    """Whether a step changes the sum of squares hardly at all, if residuals are linear."""
    after = here.value + here.slopes @ step
    return bool(after @ after >= (1 - _HARDLY) * (here.value @ here.value))
