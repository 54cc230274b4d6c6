"""Parameters of a scene for which a quantity of an orbit, or of a special point, is least.

A quasi-Newton method (BFGS) with bounds, whose gradients are by the implicit function theorem. As
in `design`, the orbit or the point is followed.

Reference: Nocedal, Wright (2006), Numerical Optimization, chapter 6.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn._checks import array, check_callable, check_on_host, fail, positive, whole
from jaxdyn.status import Code, Ended
from orbits.closing.closings import Hold
from orbits.orbit import SearchError
from orbits.shooting.strategy import SECONDS
from orbits.targets.followed import Asked, At, Near, Search, TimeLimit, bounds, follow

_LONGEST = 0.3  # longest step, in units of the parameters
_DECREASE = 1e-4  # least decrease, relative to that of the linear part
#: A gradient jumps if a step shorter than the first number changes it by more than the second,
#: relative to its norm at the guess.
_SHORT, _JUMP = 1e-9, 0.1
_ROUNDING = 1e-13  # relative: changes of the quantity below this are rounding


class OptimumOutcome(Code):
    """How a search for an optimum ended."""

    FOUND = 0, "The quantity is least, as far as bounds allow."
    LOST = (
        1,
        "No step keeps the orbit, or the point, and makes the quantity smaller: it may end in a "
        "fold on the way. Start elsewhere, or give bounds.",
    )
    STEP_LIMIT = 2, "The search reached its step limit. Continue from here, or increase steps."
    TIME_LIMIT = 3, "The time is up. Continue from here, or increase seconds."
    CORNER = (
        4,
        "The quantity is least at a corner, as |x| is at 0, where its derivative does not vanish. "
        "Minimise a smooth one, such as its square, or let orbits.design find where it is 0.",
    )


@dataclasses.dataclass(frozen=True)
class Optimum(Ended):
    """Parameters of a scene for which a quantity is least.

    Attributes:
      numbers: (n,) the parameters.
      found: the orbit, or the special point, or a tuple of them.
      value: the quantity.
      slopes: (n,) its derivatives with respect to the parameters.
      steps: number of steps taken.
      outcome: how the search ended.
    """

    numbers: np.ndarray
    found: Any
    value: float
    slopes: np.ndarray
    steps: int
    outcome: OptimumOutcome

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [
            ("numbers", _text.brief(self.numbers)),
            ("value", _text.brief(self.value)),
            ("steps", str(self.steps)),
            ("outcome", f"{self.outcome.name}: {self.message}"),
        ]
        return _text.table("Optimum", rows)

    _repr_html_ = _text.html


def minimise(
    make: Callable[[Array], Any],
    quantity: Callable[[Any], Any],
    guess,
    near: Near | Sequence[Near],
    *,
    lower=None,
    upper=None,
    hold: Hold = (),
    goal: float = 1e-8,
    steps: int = 50,
    seconds: float = SECONDS,
    throw: bool = True,
) -> Optimum:
    """Parameters of a scene for which a quantity of an orbit, or a special point, is least.

    For the widest interval between two special points, minimise minus its width.

    Args:
      make: see `design`.
      quantity: a function that returns the number to be minimised; its argument is that of `wanted`
        of `design`.
      guess: (n,) the parameters to which `near` belongs.
      near: the orbit, the special point, or a list of several; see `design`.
      lower: (n,) lower bounds of the parameters; -inf for none.
      upper: (n,) upper bounds.
      hold: conditions on the orbit, as for `find`.
      goal: largest derivative with respect to the logarithm of a parameter, relative to the
        quantity, at which the quantity counts as least; it may be larger at a bound.
      steps: largest number of steps.
      seconds: time limit, without that of compiling; what is being computed then is completed.
      throw: raise unless it is least; with False check `Optimum.outcome`.
    Returns:
      The parameters, the quantity, and what is followed.
    Raises:
      ValueError: see `design`; or the quantity is not one number.
      SearchError: the search failed (``throw=True``).
    Limits: host only; a local minimum, of a quantity that is smooth there.
    Example:
      >>> import jax.numpy as jnp, orbits
      >>> from jaxdyn import scenes
      >>> def make(numbers):  # a rod that swings about a point at a distance from its middle
      ...     return scenes.oscillator(k=9.81 * numbers[0], m=1 / 12 + numbers[0] ** 2)
      >>> swing = orbits.find(make(jnp.array([0.4])), [1.0, 0.0], 2.0, hold="x")
      >>> found = orbits.minimise(
      ...     make, lambda orbit: orbit.period, [0.4], swing, hold="x", lower=[0.1])
      >>> round(float(found.numbers[0]), 6)  # 1 / sqrt(12)
      0.288675
    """
    check_on_host("minimise", guess, "Call it outside jit, grad and vmap.")
    numbers = np.asarray(array("guess", guess, (None,), "For one number write [10.0]."))
    low, high = bounds(lower, upper, numbers)
    steps = whole("steps", steps)
    positive("goal", goal)
    limit = TimeLimit(seconds)
    check_callable("make", make, "numbers")
    check_callable("quantity", quantity, "found")
    followed, known = follow(make, near, hold)
    search = _Search(followed, Asked("quantity", quantity), low, high, goal, limit)
    found = search.run(numbers, known, steps)
    if throw and not found.ok:
        raise SearchError(found.message)
    return found


class _Search(Search):
    """The BFGS method on the parameters that no bound holds; steps are halved until they descend.

    Parameters are in units of their first values. The unit of one that is 0 is the change by which
    the quantity changes by its own value.
    """

    def run(self, numbers: np.ndarray, near: Any, steps: int) -> Optimum:
        here = self.followed.at(numbers, near, self.asked)
        if len(here.value) != 1:
            raise fail("quantity", "one number", f"{len(here.value)} numbers")
        units = here.units
        curvature, first = None, float(np.linalg.norm(here.slopes[0] * units))
        for n in range(steps + 1):
            gradient = here.slopes[0] * units
            free = self._free(here, gradient)
            if np.abs(gradient[free]).max(initial=0.0) <= self.goal * abs(here.value[0]):
                return self._optimum(here, n, OptimumOutcome.FOUND)
            if n == steps:
                break
            if curvature is None:
                curvature = np.linalg.norm(gradient) / _LONGEST * np.eye(len(units))
            step = np.zeros(len(units))
            step[free] = -np.linalg.solve(curvature[np.ix_(free, free)], gradient[free])
            step *= min(1.0, _LONGEST / np.abs(step).max())
            new = self.shorten(here, step * units)
            if new is None:
                over = self.limit.over
                lost = OptimumOutcome.TIME_LIMIT if over else OptimumOutcome.LOST
                return self._optimum(here, n, lost)
            moved = (new.numbers - here.numbers) / units
            change = new.slopes[0] * units - gradient
            if np.linalg.norm(moved) < _SHORT and np.linalg.norm(change) > _JUMP * first:
                return self._optimum(new, n + 1, OptimumOutcome.CORNER)
            curvature = _update(curvature, moved, change)
            here = new
        return self._optimum(here, steps, OptimumOutcome.STEP_LIMIT)

    def _free(self, here: At, gradient: np.ndarray) -> np.ndarray:
        """(n,) whether each parameter may move downhill: no bound is in the way."""
        outwards = (here.numbers <= self.low) & (gradient > 0)
        return ~(outwards | ((here.numbers >= self.high) & (gradient < 0)))

    def accepts(self, here: At, new: At) -> bool:
        # A step that is clipped at bounds may lead uphill.
        expected = min(here.slopes[0] @ (new.numbers - here.numbers), 0.0)
        least = _DECREASE * expected + _ROUNDING * abs(here.value[0])
        return bool(new.value[0] - here.value[0] <= least)

    @staticmethod
    def _optimum(here: At, steps: int, outcome: OptimumOutcome) -> Optimum:
        value = float(here.value[0])
        return Optimum(here.numbers, here.found, value, here.slopes[0], steps, outcome)


def _update(curvature: np.ndarray, moved: np.ndarray, change: np.ndarray) -> np.ndarray:
    """(n, n) the BFGS update of the curvature, skipped where the quantity is not convex."""
    along, ahead = float(change @ moved), curvature @ moved
    if not along > 1e-8 * np.linalg.norm(change) * np.linalg.norm(moved) > 0:
        return curvature
    return (
        curvature - np.outer(ahead, ahead) / float(moved @ ahead) + np.outer(change, change) / along
    )
