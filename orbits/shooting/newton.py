"""Newton's method for residuals whose Jacobian is rank deficient by nature, within bounds.

Closing conditions have a kernel: an orbit may be shifted in time, moved, turned, scaled, and
still closes. Of all steps that solve the linearised equations we take the shortest (by singular
values, dropping those that are rounding), so the iteration ends near where it began, and damp
it so that the residual falls: full steps from a rough guess wander off to other orbits or to
the trivial one.

The last stage is always Newton on the vector of residuals. Descent on its square loses half of
the digits: at a closing error of 1e-8 the square is at the rounding level already.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

#: Singular values below this share of the largest are the kernel, where the residual is not
#: small. The smallest true one of the figure-eight is 1e-3 of the largest, those of unstable
#: orbits cut into segments are far smaller; those of the kernel fall with the residual.
RANK_TOLERANCE = 1e-7
_RANK_FLOOR = 1e-11  # the kernel's singular values are rounding at last
_DAMPING_START = 0.1  # of the residual; from 0.01 on, rough guesses end anywhere
_DAMPING_GROW, _DAMPING_SHRINK = 4.0, 0.25
_DAMPING_MAX = 1e8
_STALLED = 2  # steps without progress that mean the rounding level
_NOISY = (
    4  # tries in which rounding shows, one shorter than the other: what it hides may still help
)
_SHORTER = 0.5  # of a step that was refused: less of a change is not worth a try
_CRAWL = 0.1  # of the residual: where a whole Newton step near a solution leaves more, it rounds
_WORTH = 0.3  # of the residual: where a step below the goal leaves more, it is mostly rounding
_NEARLY = 1e-6  # a residual below which misfits of the linear model may be rounding


@dataclasses.dataclass(frozen=True)
class Iteration:
    """What a progress report shows of one step."""

    index: int
    residual: float  # largest entry
    period: float
    step: float  # length of the step that led here


@dataclasses.dataclass(frozen=True)
class Result:
    """Where Newton's method ended."""

    x: np.ndarray
    residual: np.ndarray
    iterations: int
    converged: bool
    at_bound: bool
    limit: bool


@dataclasses.dataclass(frozen=True)
class _Refused:
    """A step that was tried and not taken: its length, and what the linear model missed."""

    step: float
    misfit: float


Equations = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


# Residuals near the largest floats: their squares are infinite, and no step is better.
@np.errstate(over="ignore", invalid="ignore")
def solve(
    equations: Equations,
    x: np.ndarray,
    *,
    lower: np.ndarray,
    upper: np.ndarray,
    goal: float,
    max_iterations: int,
    keep_going: Callable[[np.ndarray], bool] = lambda x: True,
    report: Callable[[Iteration], None] = lambda iteration: None,
) -> Result:
    """The point near x, within the bounds, where the residual is smallest.

    Args:
      equations: x -> residual (m,) and Jacobian (m, n); NaN where there is no value.
      x: (n,) start; the last entry is the period, for the report.
      lower: (n,) lower bounds.
      upper: (n,) upper bounds.
      goal: largest entry of the residual that counts as solved. The iteration goes on below
        it while that still helps, to the rounding level.
      max_iterations: steps at most, refused ones not counted.
      keep_going: false stops the iteration at an accepted point (a run-away).
      report: called after each accepted step.
    """
    residual, jacobian = equations(x)
    factors = _factors(jacobian)
    report(Iteration(0, _size(residual), x[-1], 0.0))
    best, stalled, accepted = x, 0, 0
    best_residual = residual
    damping = _DAMPING_START
    refused: _Refused | None = None
    noisy = 0
    while accepted < max_iterations and _finite(residual, jacobian):
        step = _step(residual, jacobian, factors, x, lower, upper, damping * _norm(residual))
        while refused and _norm(step) > _SHORTER * refused.step and damping <= _DAMPING_MAX:
            damping *= _DAMPING_GROW
            step = _step(residual, jacobian, factors, x, lower, upper, damping * _norm(residual))
        new = np.clip(x + step, lower, upper)
        new_residual, new_jacobian = equations(new)
        solved = _size(residual) <= goal
        falls = _norm(new_residual) < (2.0 if solved else 1.0) * _norm(residual)
        if not (falls and _finite(new_jacobian)):
            damping *= _DAMPING_GROW
            misfit = _norm(new_residual - residual - jacobian @ (new - x))
            if solved or damping > _DAMPING_MAX or np.array_equal(new, x):
                break
            # What is not linear falls with the square of a step; rounding stays.
            rounding = refused is not None and misfit > _SHORTER * refused.misfit
            noisy = noisy + 1 if rounding and _size(residual) < _NEARLY else 0
            if noisy >= _NOISY:
                break
            refused = _Refused(_norm(step), misfit)
            continue
        refused, noisy = None, 0
        damping *= _DAMPING_SHRINK
        accepted += 1
        x, residual, jacobian = new, new_residual, new_jacobian
        if not solved:  # what is left is rounding: the Jacobian does not change any more
            factors = _factors(jacobian)
        report(Iteration(accepted, _size(residual), x[-1], _norm(step)))
        progress = _WORTH if solved else _CRAWL
        near = _size(residual) < _NEARLY
        stalled = stalled + 1 if near and _size(residual) > progress * _size(best_residual) else 0
        if _size(best_residual) > goal or _size(residual) < _size(best_residual):
            best, best_residual = x, residual
        if not keep_going(x) or stalled >= _STALLED or not residual.any():
            break
    bounded = ((best <= lower) | (best >= upper)) & (lower < upper)  # not what is held fixed
    return Result(
        best,
        best_residual,
        accepted,
        converged=bool(_size(best_residual) <= goal),
        at_bound=bool(bounded.any()),
        limit=accepted >= max_iterations,
    )


def _step(residual, jacobian, factors, x, lower, upper, damping) -> np.ndarray:
    """The shortest damped step; unknowns that it would push beyond a bound stay there."""
    free = np.ones(len(x), dtype=bool)
    step = np.zeros(len(x))
    for _ in range(len(x)):
        target = residual + jacobian @ step
        move = _shortest(target, factors, damping)
        trial = step.copy()
        trial[free] = move
        out = free & ((x + trial < lower) | (x + trial > upper))
        if not out.any():
            return trial
        step[out] = np.clip(x + trial, lower, upper)[out] - x[out]
        free &= ~out
        if not free.any():
            break
        factors = _factors(jacobian[:, free])
    return step


def _factors(jacobian: np.ndarray):
    """Singular value decomposition, once for all the dampings that are tried; None for NaN."""
    return np.linalg.svd(jacobian, full_matrices=False) if _finite(jacobian) else None


def _shortest(residual, factors, damping) -> np.ndarray:
    u, s, vt = factors
    tolerance = np.clip(10 * _norm(residual), _RANK_FLOOR, RANK_TOLERANCE)
    kept = s > tolerance * s[0] if s.size else np.zeros(0, bool)
    s, u, vt = s[kept], u[:, kept], vt[kept]
    return -vt.T @ (s / (s * s + damping * damping) * (u.T @ residual))


def _finite(*arrays: np.ndarray) -> bool:
    return all(np.isfinite(array).all() for array in arrays)


def _size(residual: np.ndarray) -> float:
    return float(np.max(np.abs(residual), initial=0.0))


def _norm(x: np.ndarray) -> float:
    return float(np.linalg.norm(x))
