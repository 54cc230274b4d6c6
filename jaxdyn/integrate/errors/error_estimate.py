"""Error estimates of solutions: by a finer solution to compare with, and by the effect of rounding.

A solution at a tolerance differs from one at a thousandth of it by its own error, up to a
thousandth. That is the whole estimate while the second one is more accurate. Once rounding
dominates, both solutions may share the same rounding error, so that their difference hides it;
therefore `rounding_error` measures it separately.

This file has the arithmetic, for anything that can be run at a tolerance; it is used by
`accuracy` and `simulate(digits=...)`.
"""

import itertools
import warnings
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.integrate.errors.estimate import (
    ROUNDING_MARGIN,
    Estimate,
    digits_of,
    gaps,
    kind_of,
    scales,
)
from jaxdyn.integrate.errors.rounding_error import Run, of_writing, rounding
from jaxdyn.scene import Scene

Names = tuple[str, str, str]

#: Ratio of the tolerances of the two solutions; their errors are in about the same ratio.
RATIO = 1e-3
MOST_DIGITS = 15
FINEST = 1e-16  # relative tolerance; a smaller one only adds steps
_BESIDE_RATIO = 3.0  # ratio of tolerances that are as good but give different steps
_COARSENING = 10.0  # factor, where a tolerance is below what the scene allows
_MAX_RTOL = 1e-2
_MIN_ORDER = 0.5  # below it the steps are too large, or rounding dominates
_MAX_TRIES = 5  # most tolerances that are tried, to reach the requested digits
_AIM_RATIO = 0.3  # part of the requested error to aim at after a tolerance has missed it
_NORMAL_MEDIAN = 0.6745  # median magnitude of a normal variable, in standard deviations
_STEPS_RATIO = 1.3  # least ratio of the steps of a finer solution to those of the first
_NEAR_LIMIT_DIGITS = 1.5  # digits from the limit within which two draws do not decide
_DRAWS_AT_LIMIT = 6
_LIMIT_RTOL = 1e-12  # tolerance for whose finer solution the limit is measured


def measure(
    run: Run, scene: Scene, ts: Array, tolerance: np.ndarray, names: Names, by=None
) -> tuple[Any, Estimate]:
    """The solution at a tolerance, and its error estimated from a finer one and from rounding.

    Args:
      run: solves a scene at a tolerance.
      scene: system, effects, start.
      ts: (s,) times of the computed states [s].
      tolerance: (2,) relative tolerance, and absolute one in parts of the motion's sizes.
      names: names of the estimate, of the solver, and of the finer solution's solver.
      by: runs the finer solution; `run` by default.
    """
    rungs = _rungs(run, by or run, scene, tolerance)
    floor = rounding(by or run, scene, rungs.fine, rungs.finer)
    return rungs.result, _estimate(rungs, scene, ts, floor, names)


class _Rungs(NamedTuple):
    """A solution at a tolerance, and two (s, k) to compare it with.

    Attributes:
      result: the solution.
      fine: states of a finer one.
      beside: states of another one, about as fine.
      tolerance: (2,) the tolerances of the solution.
      finer: (2,) the tolerances of the finer one.
    """

    result: Any
    fine: np.ndarray
    beside: np.ndarray
    tolerance: np.ndarray
    finer: np.ndarray


def _rungs(run: Run, by: Run, scene: Scene, tolerance: np.ndarray) -> _Rungs:
    result = run(scene, tolerance)
    fine, finer = _finer(by, scene, tolerance, int(result.steps))
    beside = np.asarray(by(scene, _beside(finer)).ys)
    return _Rungs(result=result, fine=fine, beside=beside, tolerance=tolerance, finer=finer)


def _estimate(rungs: _Rungs, scene: Scene, ts: Array, floor: np.ndarray, names: Names) -> Estimate:
    """The estimate from these solutions, if rounding moves the states by `floor` (s, k)."""
    ys, fine = np.asarray(rungs.result.ys), rungs.fine
    off = gaps(scene, ys, fine) + np.nan_to_num(0.5 * gaps(scene, fine, rungs.beside))
    error = _expected_error(np.abs(off), floor, ys, finer=2)
    kind, solver, other = names
    return Estimate(
        ts=ts,
        ys=rungs.result.ys,
        error=error,
        rounding=floor,
        scale=scales(scene, fine),
        fineness=np.array([rungs.tolerance[0], rungs.finer[0]]),
        kind=kind_of(kind, scene),
        solver=solver,
        other=other,
    )


def reach(
    run: Run, scene: Scene, ts: Array, digits: float, solver: str, refuse: bool
) -> tuple[Any, Estimate]:
    """The solution with this many digits at all times, or the best, and its estimate.

    The tolerance starts at the requested error and is tightened by the estimated miss.

    Args:
      run: solves a scene at a tolerance.
      scene: system, effects, start.
      ts: (s,) times of the computed states [s].
      digits: number of digits requested.
      solver: name of the method.
      refuse: raise where fewer digits, but some, are possible.
    Raises:
      ValueError: `digits` is not between 1 and `MOST_DIGITS`, or, with `refuse`, more than the
        motion allows.
    """
    if _checks.is_traced((scene, ts, digits)):
        raise _checks.fail("digits", "numbers", "a traced value", "Pass rtol inside jit and grad.")
    if not 0 < digits <= MOST_DIGITS:
        raise _checks.fail(
            "digits", f"between 1 and {MOST_DIGITS}", digits, "Doubles have not quite 16."
        )
    wanted = 10.0**-digits
    names = ("tolerance ladder", solver, solver)
    floor = None
    rtol = min(wanted, _MAX_RTOL)
    for _ in range(_MAX_TRIES):
        rtol = max(rtol, FINEST)
        rungs = _rungs(run, run, scene, np.full(2, rtol))
        if floor is None:
            floor = _limit(run, scene, rungs, digits)
        result, found = rungs.result, _estimate(rungs, scene, ts, floor, names)
        missed = float(np.max((found.error + ROUNDING_MARGIN * floor) / found.scale)) / wanted
        short = found.most_digits < digits
        if not (missed > 1 or short) or rtol <= FINEST:
            break
        if short:  # then it is to be accurate for as long as possible
            missed = max(missed, rtol / FINEST)
        rtol *= _AIM_RATIO / missed
    found = eqx.tree_at(lambda e: e.wanted, found, digits, is_leaf=lambda x: x is None)
    if found.shortfall:
        if refuse and 1 <= found.most_digits < digits:
            most = np.floor(10 * found.most_digits) / 10
            raise _checks.fail(
                "digits",
                f"at most {most:g} for this motion",
                digits,
                "Rounding alone moves it by more. Ask for fewer, or shorten the span.",
            )
        warnings.warn(found.shortfall, stacklevel=3)
    return result, found


def halve_steps(run: Run, scene: Scene, ts: Array, h: float, name: str) -> Estimate:
    """The error of a solution with equal steps h, estimated from h / 2 and h / 4.

    Differences of the three show the order p; the first and the last differ by (1 - 4^-p) times
    the error of the first.
    """
    ys = [np.asarray(run(scene, np.array([h / n])).ys) for n in (1, 2, 4)]
    moved = [np.abs(gaps(scene, a, b)).max() for a, b in itertools.pairwise(ys)]
    with np.errstate(divide="ignore", invalid="ignore"):
        order = float(np.log2(moved[0] / moved[1]))
    falls = 1 - 4.0 ** -max(order, _MIN_ORDER)
    floor = rounding(run, scene, ys[2], np.array([h / 4]))
    error = _expected_error(np.abs(gaps(scene, ys[0], ys[2])) / falls, floor, ys[0], finer=1)
    return Estimate(
        ts=ts,
        ys=ys[0],
        error=error,
        rounding=floor,
        scale=scales(scene, ys[2]),
        fineness=np.array([h, h / 4]),
        kind=kind_of(f"step halving, order {order:.2g} observed", scene),
        solver=name,
        other=name,
    )


def _tighten(tolerance: np.ndarray) -> np.ndarray:
    """A thousandth of the tolerance, with a relative part that is not below the finest.

    The finest tolerance is changed by a small factor instead, so that the steps differ.
    """
    ratio = max(RATIO, FINEST / tolerance[0])
    return _beside(tolerance) if ratio > 0.5 else np.maximum(tolerance * ratio, [FINEST, 0.0])


def _beside(tolerance: np.ndarray) -> np.ndarray:
    """A third of the tolerance; three times it where that is below the finest."""
    return tolerance * (
        1 / _BESIDE_RATIO if tolerance[0] > _BESIDE_RATIO * FINEST else _BESIDE_RATIO
    )


def _finer(
    run: Run, scene: Scene, tolerance: np.ndarray, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """(s, k) a solution finer than one of that many steps, NaN if none is, and its tolerance.

    The tolerance is a thousandth of the given one; it is less where that takes hardly more steps,
    as when the span is shorter than the first step, and more where it is too small for the scene.
    """
    ys, fine = None, _tighten(tolerance)
    while True:
        result = run(scene, fine)
        if not np.isfinite(np.asarray(result.ys)).all():
            if ys is not None or fine[0] * _COARSENING > tolerance[0]:
                break
            fine = fine * _COARSENING
            continue
        ys, used = np.asarray(result.ys), fine
        if result.steps >= _STEPS_RATIO * steps or fine[0] <= FINEST * _COARSENING:
            return ys, used
        fine = _tighten(fine)
    return (np.full_like(np.asarray(result.ys), np.nan), tolerance) if ys is None else (ys, used)


def _limit(run: Run, scene: Scene, rungs: _Rungs, digits: float) -> np.ndarray:
    """(s, k) the effect of rounding on the states; one value for all `digits` near the limit.

    Two random perturbations determine it to a factor of ten or so, and it depends somewhat on the
    steps. Where that could decide whether the digits are possible, it is measured with more draws
    and at one tolerance for every number of digits, so that the limit is one number.
    """
    floor = rounding(run, scene, rungs.fine, rungs.finer)
    scale = scales(scene, rungs.fine)
    if digits_of(ROUNDING_MARGIN * np.max(floor / scale)) > digits + _NEAR_LIMIT_DIGITS:
        return floor
    fine, finer = _finer(run, scene, np.full(2, _LIMIT_RTOL), 0)
    return rounding(run, scene, fine, finer, draws=_DRAWS_AT_LIMIT)


def _expected_error(gap: np.ndarray, floor: np.ndarray, ys: np.ndarray, finer: int) -> np.ndarray:
    """(s, k) expected size of the error of states `ys` that are a gap from the mean of finer ones.

    All have rounding errors of root mean square `floor`; the states `ys` also have the error of
    their tolerance, whose size follows from the gap. The error of the states is their share of
    the gap plus a normal deviation, whose median is taken.
    """
    wide = gap > np.sqrt(1 + 1 / finer) * floor
    share = 1 - np.where(wide, (floor / np.where(wide, gap, 1.0)) ** 2 / finer, 1 / (finer + 1))
    error = np.hypot(share * gap, _NORMAL_MEDIAN * np.sqrt(share / finer) * floor)
    return np.maximum(error, of_writing(ys))
