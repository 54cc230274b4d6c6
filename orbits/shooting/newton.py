"""Newton's method for residuals whose Jacobian is rank deficient by nature, within bounds.

The solutions of closing conditions are not isolated: an orbit that is shifted in time, translated,
rotated or scaled still closes. Of all steps that solve the linearised equations the shortest is
taken (from a singular value decomposition without the singular values that are rounding), so that
the iteration ends near its start. Steps are damped so that the norm of the residual
decreases: full steps from a rough guess lead to other orbits or to trivial ones.

The last stage of any search is Newton's method on the residual itself. Descent on the square of the
residual loses half of the digits: at a closing error of 1e-8 it is already at the rounding level.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

#: Singular values below this share of the largest span the kernel, unless the residual is small.
#: The smallest true one of the figure-eight is 1e-3 of the largest, and those of unstable orbits
#: cut into segments are far smaller; those of the kernel decrease with the residual.
RANK_TOLERANCE = 1e-7
#: The same share at the end of the iteration, where singular values of the kernel are rounding.
_RANK_TOLERANCE_LEAST = 1e-11
#: First damping, in units of the residual's norm; with 0.01 rough guesses end on distant orbits.
_DAMPING_START = 0.1
_DAMPING_GROW, _DAMPING_SHRINK = 4.0, 0.25
_DAMPING_MAX = 1e8
#: Steps without progress after which the residual counts as rounding: at a solution, and above the
#: goal, where damping may still shorten steps and a double root only halves the residual.
_STALLED_STEPS, _STALLED_ABOVE = 2, 8
#: Consecutive rejected steps, each at most half as long as the one before, whose misfits indicate
#: rounding: fewer would end iterations that rounding only slows down.
_NOISY_STEPS = 4
#: A step is at most this fraction of the rejected step before it; longer ones would fail as well.
_SHORTER = 0.5
#: Steps near a solution that leave a larger share of the residual than this make no progress.
_SHARE_LEFT = 0.1
#: The same below the goal, where part of the residual is rounding.
_SHARE_LEFT_SOLVED = 0.3
#: Below this residual, misfits of the linear model may be rounding.
_ROUNDING_SHOWS = 1e-6

#: x (n,) -> residual (m,) and Jacobian (m, n); NaN where there is no value.
Residual = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclasses.dataclass(frozen=True)
class Iteration:
    """The progress report of one step."""

    index: int
    residual: float  # largest entry
    period: float
    step: float  # length of the step that led here


@dataclasses.dataclass(frozen=True)
class Result:
    """Where Newton's method ended.

    The Jacobian is the one there, with respect to the unknowns in units; collocation, which does
    not form it, leaves None.
    """

    x: np.ndarray
    residual: np.ndarray
    iterations: int
    converged: bool
    at_bound: bool
    limit: bool
    jacobian: np.ndarray | None = None


class _Point(NamedTuple):
    """An iterate; its `factors` may be those of an earlier iterate."""

    x: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    factors: tuple[np.ndarray, np.ndarray, np.ndarray] | None


class _Rejected(NamedTuple):
    """A rejected step: its length, and the misfit of the linear model."""

    step: float
    misfit: float


class _Bounds(NamedTuple):
    lower: np.ndarray
    upper: np.ndarray
    units: np.ndarray


# Squares of residuals near the largest floats overflow to infinity; then no step is accepted.
@np.errstate(over="ignore", invalid="ignore")
def solve(
    equations: Residual,
    x: np.ndarray,
    *,
    lower: np.ndarray,
    upper: np.ndarray,
    goal: float,
    max_iterations: int,
    keep_going: Callable[[np.ndarray], bool] = lambda x: True,
    over: Callable[[], bool] = lambda: False,
    report: Callable[[Iteration], None] = lambda iteration: None,
    units: np.ndarray | float = 1.0,
) -> Result:
    """The point near x, within the bounds, where the residual is smallest.

    Args:
      equations: the residual, and its Jacobian with respect to the unknowns in their units.
      x: (n,) start; the last entry is the period, for the report.
      lower: (n,) lower bounds.
      upper: (n,) upper bounds.
      goal: largest entry of the residual of a solution. The iteration continues below it, down
        to the rounding level, as long as it makes progress.
      max_iterations: largest number of accepted steps.
      keep_going: called with each accepted point; False ends the iteration.
      over: called before each evaluation, also after rejected steps; True ends the iteration.
      report: called after each accepted step.
      units: (n,) units of x, in which lengths of steps are measured.
    """
    bounds = _Bounds(lower, upper, np.broadcast_to(units, np.shape(x)))
    residual, jacobian = equations(x)
    point = _Point(x=x, residual=residual, jacobian=jacobian, factors=_factors(jacobian))
    report(Iteration(index=0, residual=_size(residual), period=x[-1], step=0.0))
    best, accepted = point, 0
    mark, stalled = _size(residual), 0
    damping, rejected, noisy = _DAMPING_START, None, 0
    while accepted < max_iterations and _finite(point.residual, point.jacobian) and not over():
        step, damping = _damp(point, bounds, damping, rejected)
        new = np.clip(point.x + step * bounds.units, lower, upper)
        residual, jacobian = equations(new)
        solved = _size(point.residual) <= goal
        falls = _norm(residual) < (2.0 if solved else 1.0) * _norm(point.residual)
        if not (falls and _finite(jacobian)):
            damping *= _DAMPING_GROW
            if solved or damping > _DAMPING_MAX or np.array_equal(new, point.x):
                break
            moved = (new - point.x) / bounds.units
            misfit = _norm(residual - point.residual - point.jacobian @ moved)
            # The nonlinear part decreases with the square of the step; rounding does not.
            rounding = rejected is not None and misfit > _SHORTER * rejected.misfit
            noisy = noisy + 1 if rounding and _size(point.residual) < _ROUNDING_SHOWS else 0
            if noisy >= _NOISY_STEPS:
                break
            rejected = _Rejected(_norm(step), misfit)
            continue
        rejected, noisy = None, 0
        damping *= _DAMPING_SHRINK
        accepted += 1
        # At a solution the Jacobian changes no more.
        factors = point.factors if solved else _factors(jacobian)
        point = _Point(x=new, residual=residual, jacobian=jacobian, factors=factors)
        size, least = _size(residual), _size(best.residual)
        report(Iteration(index=accepted, residual=size, period=new[-1], step=_norm(step)))
        progress = size <= (_SHARE_LEFT_SOLVED if solved else _SHARE_LEFT) * mark
        progress |= size >= _ROUNDING_SHOWS
        mark, stalled = (size, 0) if progress else (mark, stalled + 1)
        if least > goal or size < least:
            best = point
        most = _STALLED_STEPS if min(size, least) <= goal else _STALLED_ABOVE
        if not keep_going(new) or stalled >= most or not residual.any():
            break
    return _result(best, bounds, goal, accepted, max_iterations)


def first_step(
    x: np.ndarray,
    residual: np.ndarray,
    jacobian: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    units: np.ndarray,
    damping: float,
) -> np.ndarray:
    """(n,) a damped step from x, within the bounds, for an iteration that need not descend."""
    point = _Point(x=x, residual=residual, jacobian=jacobian, factors=_factors(jacobian))
    return units * _step(point, _Bounds(lower, upper, units), damping)


def _result(best: _Point, bounds: _Bounds, goal: float, accepted: int, most: int) -> Result:
    lower, upper, units = bounds
    # Fixed entries do not count.
    at_bound = ((best.x <= lower) | (best.x >= upper)) & (lower < upper)
    # Entries that are 0 up to rounding become 0: an entry at rest there has no size of its own.
    nothing = (np.abs(best.x) <= np.finfo(float).eps * units) & (lower <= 0) & (0 <= upper)
    return Result(
        x=np.where(nothing, 0.0, best.x),
        residual=best.residual,
        jacobian=best.jacobian,
        iterations=accepted,
        converged=bool(_size(best.residual) <= goal),
        at_bound=bool(at_bound.any()),
        limit=accepted >= most,
    )


def _damp(
    point: _Point, bounds: _Bounds, damping: float, rejected: _Rejected | None
) -> tuple[np.ndarray, float]:
    """The damped step, clearly shorter than the one rejected before it, and its damping."""
    step = _step(point, bounds, damping)
    while rejected and _norm(step) > _SHORTER * rejected.step and damping <= _DAMPING_MAX:
        damping *= _DAMPING_GROW
        step = _step(point, bounds, damping)
    return step, damping


def _step(point: _Point, bounds: _Bounds, damping: float) -> np.ndarray:
    """The shortest damped step, in units; unknowns that would pass a bound end on it."""
    x, residual, jacobian, factors = point
    lower, upper, units = bounds
    damping = damping * _norm(residual)
    free = np.ones(len(x), dtype=bool)
    step = np.zeros(len(x))
    for _ in range(len(x)):
        target = residual + jacobian @ step
        move = _shortest(target, factors, damping)
        trial = step.copy()
        trial[free] = move
        new = x + units * trial
        out = free & ((new < lower) | (new > upper))
        if not out.any():
            return trial
        step[out] = ((np.clip(new, lower, upper) - x) / units)[out]
        free &= ~out
        if not free.any():
            break
        factors = _factors(jacobian[:, free])
    return step


def _factors(jacobian: np.ndarray):
    """The singular value decomposition, which all dampings share; None for a Jacobian with NaN."""
    return np.linalg.svd(jacobian, full_matrices=False) if _finite(jacobian) else None


def _shortest(residual, factors, damping) -> np.ndarray:
    u, s, vt = factors
    tolerance = np.clip(10 * _norm(residual), _RANK_TOLERANCE_LEAST, RANK_TOLERANCE)
    kept = s > tolerance * s[0] if s.size else np.zeros(0, bool)
    s, u, vt = s[kept], u[:, kept], vt[kept]
    return -vt.T @ (s / (s * s + damping * damping) * (u.T @ residual))


def _finite(*arrays: np.ndarray) -> bool:
    return all(np.isfinite(array).all() for array in arrays)


def _size(residual: np.ndarray) -> float:
    return float(np.max(np.abs(residual), initial=0.0))


def _norm(x: np.ndarray) -> float:
    return float(np.linalg.norm(x))
