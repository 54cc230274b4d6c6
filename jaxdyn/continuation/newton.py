"""The corrector: Newton's method on the host, for the unknowns of a point of a branch.

It begins near a solution, in unknowns and equations without units, and ends where its steps become
small: after such a step the next one leaves only rounding. It thus decides whether there is a
solution nearby, and does not search for one far away (`orbits.shooting.newton` does).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

_SETTLED = 1e-8  # relative size of a step after which one more leaves only rounding

#: A function of x (n,) that returns the residual (m,) and the Jacobian (m, n), which are NaN where
#: they are undefined, and further data.
Equations = Callable[[np.ndarray], tuple]


class Solution(NamedTuple):
    """Where Newton's method ended: where it settled, or else at its best iterate.

    Attributes:
      x: (n,) unknowns.
      value: (m,) residual.
      jacobian: (m, n) Jacobian there.
      more: further data that the equations return there.
      iterations: number of steps to it, without the steps of the polish.
      settled: whether the last step was small.
    """

    x: np.ndarray
    value: np.ndarray
    jacobian: np.ndarray
    more: tuple
    iterations: int
    settled: bool = False

    @property
    def residual(self) -> float:
        """The largest entry of the residual."""
        return float(np.abs(self.value).max())

    @property
    def finite(self) -> bool:
        """Whether the equations have finite values there."""
        return bool(np.isfinite(self.value).all() and np.isfinite(self.jacobian).all())


def solve(
    equations: Equations,
    start: np.ndarray,
    *,
    steps: int = 10,
    rank: float | None = None,
    polish: int = 0,
    halvings: int = 0,
    diverged: float = math.inf,
) -> Solution:
    """The point near a start where the steps of Newton's method become small.

    The caller must check that its residual is small enough.

    Args:
      equations: the equations and their Jacobian.
      start: (n,) unknowns.
      steps: largest number of steps; more mean that the start was too far away.
      rank: None for equations that are independent and as many as the unknowns. For others, steps
        are least-squares solutions of least norm, without singular values below this part of the
        largest.
      polish: number of steps after the first small one.
      halvings: how often a step is halved at most until it reduces the residual or the step that
        remains (`_is_nearer`); with 0, all steps are accepted.
      diverged: growth of the residual after which there is no solution nearby.
    """
    here = best = _evaluate(equations, np.asarray(start, float), 0)
    small = 0
    for iteration in range(1, steps + polish + 1):
        if not here.finite or here.residual > diverged * best.residual:
            break
        best = min(best, here, key=lambda point: point.residual)
        try:
            change = -_newton_step(here.jacobian, here.value, rank)
        except np.linalg.LinAlgError:
            break
        damped = halvings and not small
        tried = (
            _evaluate(equations, here.x + 0.5**i * change, iteration)
            for i in range(1 + halvings if damped else 1)
        )
        new = next(
            (new for new in tried if not damped or _is_nearer(here, new, change, rank)), None
        )
        if new is None:
            break
        step, here = np.abs(new.x - here.x).max(), new
        small += small > 0 or step <= _SETTLED * (1.0 + np.abs(here.x).max())
        if small > polish and here.finite:
            return here._replace(iterations=iteration - polish, settled=True)
    return best


def _evaluate(equations: Equations, x: np.ndarray, iterations: int) -> Solution:
    value, jacobian, *more = equations(x)
    return Solution(x, np.asarray(value), np.asarray(jacobian), tuple(more), iterations)


def _is_nearer(here: Solution, new: Solution, change: np.ndarray, rank: float | None) -> bool:
    """Whether a part of a step `change` (n,) reduces the residual, or the step that remains.

    The step that remains is the next one with the same Jacobian.

    The residual alone is no criterion: along a curved valley, as beside a fold, it grows with every
    step that is not tiny (Deuflhard 2004, Newton Methods for Nonlinear Problems, section 3.3). The
    remaining step alone is none where the equations leave a direction free, in which it is
    rounding. As neither has to fall at every step, only the number of steps bounds an iteration.
    """
    if np.linalg.norm(new.value) < np.linalg.norm(here.value):
        return True
    if not np.isfinite(new.value).all():
        return False
    remaining = _newton_step(here.jacobian, new.value, rank)
    return bool(np.linalg.norm(remaining) < np.linalg.norm(change))


def _newton_step(jacobian: np.ndarray, value: np.ndarray, rank: float | None) -> np.ndarray:
    if rank is None:
        return np.linalg.solve(jacobian, value)
    return np.linalg.lstsq(jacobian, value, rcond=rank)[0]
