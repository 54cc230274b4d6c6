"""How large the error of a solution is, for anything that can be run at a tolerance.

`Estimate` is the record of what is found, with the digits it leaves; several runs are compared,
and the effect of rounding is measured. `accuracy` and `simulate(digits=...)` use it.
"""

import itertools
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn.integrate.spans import padding
from jaxdyn.plan import plan_of
from jaxdyn.scales import at_start
from jaxdyn.scene import Field, Scene
from jaxdyn.solvers.perturbed import Noise
from jaxdyn.system import Record, differences

# ---- The record of an error estimate, and differences of states in the units of their entries

#: Margin of a promised digit above the measured rounding, in spreads of two draws; 1 estimate in 26
#: is wrong by more.
ROUNDING_MARGIN = 5.0
#: Entries below this part of the change that others cause may be only rounding.
_NOTHING = 1e-10


class Estimate(Record):
    """How far a solution is from the exact one.

    Attributes:
      ts: (s,) times [s].
      ys: (s, k) the solution.
      error: (s, k) estimated absolute error of each entry, in its unit.
      rounding: (s, k) the part of it that no tolerance removes, measured at the finer solution; NaN
        where not measured. With fewer steps the solution itself may lose more digits to rounding,
        as where a force depends on a time that is large: `error` includes them.
      scale: (k,) the measure of errors: the largest entry of its kind. Angles are taken modulo a
        turn.
      kind: the kind of estimate.
      solver: name of the method of the solution.
      other: name of the method of the second solution.
      wanted: () digits requested, if any.
      fineness: (2,) tolerances, or steps, of the solution and of the second one.
    """

    ts: Array
    ys: Array
    error: Array
    rounding: Array
    scale: Array
    fineness: Array
    kind: str = eqx.field(static=True)
    solver: str = eqx.field(static=True)
    other: str = eqx.field(static=True)
    wanted: Array | float | None = None

    @_text.never_raising
    def __repr__(self) -> str:
        digits = f"{self.digits:.1f} at {len(self.ts)} times, at most {self.most_digits:.1f}"
        rows = [("digits", digits), ("basis", self.basis), ("shortfall", self.shortfall)]
        return _text.table("Estimate", rows)

    _repr_html_ = _text.html

    @property
    def relative(self) -> float:
        """Largest error relative to the scale; NaN if a run failed; host only."""
        return float(np.max(np.asarray(self.error) / np.asarray(self.scale)))

    @property
    def digits(self) -> float:
        """Correct digits at all times, 0 if none; NaN if a run failed; host only."""
        return digits_of(self.relative)

    @property
    def most_digits(self) -> float:
        """Digits certain in double precision with any solver; host only."""
        return digits_of(
            ROUNDING_MARGIN * np.max(np.asarray(self.rounding) / np.asarray(self.scale))
        )

    @property
    def basis(self) -> str:
        """The basis of the estimate, as text; host only."""
        mine, its = np.asarray(self.fineness)
        return f"{self.kind}: {self.solver} at {mine:.1e} against {self.other} at {its:.1e}"

    @property
    def shortfall(self) -> str:
        """Why requested digits were not reached, and the remedy; empty if they were; host only."""
        sure = min(self.digits, self.most_digits)
        if self.wanted is None or not sure < self.wanted:
            return ""
        held = self.until(self.wanted)
        where = "at no sample" if np.isnan(held) else f"up to t = {held:.6g}"
        return (
            f"{self.wanted:g} digits were requested; over the whole span {sure:.1f} are certain, "
            f"all of them {where}. Rounding, amplified, limits any solver to "
            f"{self.most_digits:.1f} certain digits: shorten the span."
        )

    def until(self, digits: float) -> float:
        """Time up to which this many digits are certain; NaN if at no time; host only."""
        off = np.maximum(self.error, ROUNDING_MARGIN * np.nan_to_num(self.rounding))
        # With > instead, a run that failed, whose errors are NaN, would be right to its end.
        wrong = ~((off / np.asarray(self.scale)).max(axis=1) <= 10.0**-digits)
        first = int(np.argmax(wrong)) if wrong.any() else len(wrong)
        return float(self.ts[first - 1]) if first else float("nan")


def kind_of(kind: str, scene: Scene) -> str:
    """A kind of estimate, and what the estimate, like the solution, is blind to; host only."""
    unread = plan_of(scene.field, len(scene.y0)).unread
    return f"{kind}, blind to {', '.join(sorted(unread))}" if unread else kind


def digits_of(error) -> float:
    """() correct digits at a relative error, 0 if none; NaN for an error that is not finite."""
    return max(0.0, -float(np.log10(error))) if np.isfinite(error) else float("nan")


def scales(scene: Scene, ys: np.ndarray) -> np.ndarray:
    """(k,) largest magnitude over times (s, k) of the entries of a kind, see `scales.Groups`.

    Entries that are zero, or rounding, are measured by the change that others cause; 1 if none
    does.
    """
    sizes = np.abs(gaps(scene, ys, np.zeros_like(ys))).max(axis=0)
    return np.asarray(_scales_of_kinds(scene.field, sizes, scene.y0, scene.t1))


@eqx.filter_jit
def _scales_of_kinds(field: Field, sizes: Array, y0: Array, t1: Array) -> Array:
    # Angles are not capped at a radian: differences are within a turn.
    kinds = field.groups._replace(most=(np.inf,) * len(y0))
    sizes, caused = kinds.sizes(sizes), at_start(field, kinds, jnp.zeros(()), y0, t1)[0].sizes
    sizes = jnp.where(sizes > _NOTHING * caused, sizes, caused)
    return jnp.where(sizes == 0, 1.0, sizes)


#: Rounding of an angle that is moved by half a turn and back.
_WRAPPED = 2 * np.spacing(2 * np.pi)


def gaps(scene: Scene, ys: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(s, k) differences of states: angles modulo a turn, quaternions up to the sign."""
    plain, rows = ys - others, ((0, padding(*ys.shape)), (0, 0))  # few lengths, few programs
    longer = (np.pad(x, rows, mode="edge") for x in (ys, others))
    wrapped = np.asarray(differences(scene.system, *longer))[: len(ys)]
    # Wrapping an angle rounds it; where nothing is wrapped the plain difference is exact.
    return np.where(np.abs(wrapped - plain) <= _WRAPPED, plain, wrapped)


# ---- The effect of rounding on a motion, from solving it again with each step perturbed at random
#
# Two solutions may share the same rounding error, so that their difference hides it. Relative
# perturbations in the ninth digit change the states; that change, scaled to half of the last digit,
# is the effect of rounding, however it accumulates: as the power 3/2 of the time on an orbit,
# exponentially near an unstable motion.

#: (scene, (2,) tolerance, noise of each step) -> a result whose `ys` are (s, k) states, NaN where
#: not reached.
Run = Callable[..., Any]

_PERTURBATIONS = (1e-9, 1e-13, 1e-15)  # relative to each step, to measure the effect of rounding
_MAX_LINEAR_GAP = 0.1  # part of the scale: motions farther apart do not differ linearly
_DRAWS = 2  # number of random perturbations; with one, the effects of two steps may cancel
_EPS = float(np.finfo(float).eps)


def rounding(
    run: Run, scene: Scene, ys: np.ndarray, tolerance: np.ndarray, draws: int = _DRAWS
) -> np.ndarray:
    """(s, k) the effect of rounding on the states `ys` that `run` finds at a tolerance.

    It is the root mean square of the changes of the states by random perturbations of each step,
    scaled from perturbations large enough to be measured down to half a spacing of doubles. At each
    time the largest perturbation is used for which motions stay close. Where they never do, no
    digit is certain and the scale itself is returned.
    """
    scale = scales(scene, ys)
    found = np.broadcast_to(scale, ys.shape).copy()
    known = np.zeros(len(ys), bool)
    for size in _PERTURBATIONS:
        noises = [Noise(np.asarray(size), np.asarray(draw, np.uint64)) for draw in range(draws)]
        changes = [gaps(scene, np.asarray(run(scene, tolerance, noise).ys), ys) for noise in noises]
        spread = np.sqrt(np.mean(np.square(changes), axis=0))
        close = np.logical_and.accumulate((spread / scale <= _MAX_LINEAR_GAP).all(axis=1))
        new = close & ~known
        found[new] = 0.5 * _EPS / size * spread[new]
        known |= close
        if known.all():
            break
    return np.maximum(found, storage_rounding(ys))


def storage_rounding(ys: np.ndarray) -> np.ndarray:
    """(s, k) the rounding error of storing a result."""
    return 0.5 * _EPS * np.abs(ys)


# ---- Error estimates of solutions: by a finer solution to compare with, and by the effect of
# rounding
#
# A solution at a tolerance differs from one at a thousandth of it by its own error, up to a
# thousandth. That is the whole estimate while the second one is more accurate. Once rounding
# dominates, both solutions may share the same rounding error, so that their difference hides it;
# therefore `rounding` measures it separately.
#
# This file has the arithmetic, for anything that can be run at a tolerance; it is used by
# `accuracy` and `simulate(digits=...)`.

Names = tuple[str, str, str]

#: Ratio of the tolerances of the two solutions; their errors are in about the same ratio.
RATIO = 1e-3
FINEST = 1e-16  # relative tolerance; a smaller one only adds steps
_BESIDE_RATIO = 3.0  # ratio of tolerances that are as good but give different steps
_COARSENING = 10.0  # factor of a tolerance that is smaller than the scene allows
_MAX_RTOL = 1e-2
_MIN_ORDER = 0.5  # below it the steps are too large, or rounding dominates
_MAX_TRIES = 5  # largest number of tolerances tried to reach the requested digits
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
    solutions = _three_solutions(run, by or run, scene, tolerance)
    floor = rounding(by or run, scene, solutions.fine, solutions.finer)
    return solutions.result, _estimate(solutions, scene, ts, floor, names)


class _ThreeSolutions(NamedTuple):
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


def _three_solutions(run: Run, by: Run, scene: Scene, tolerance: np.ndarray) -> _ThreeSolutions:
    result = run(scene, tolerance)
    fine, finer = _finer(by, scene, tolerance, int(result.steps))
    beside = np.asarray(by(scene, _beside(finer)).ys)
    return _ThreeSolutions(
        result=result, fine=fine, beside=beside, tolerance=tolerance, finer=finer
    )


def _estimate(
    solutions: _ThreeSolutions, scene: Scene, ts: Array, floor: np.ndarray, names: Names
) -> Estimate:
    """The estimate from these solutions, if rounding moves the states by `floor` (s, k)."""
    ys, fine = np.asarray(solutions.result.ys), solutions.fine
    off = gaps(scene, ys, fine) + np.nan_to_num(0.5 * gaps(scene, fine, solutions.beside))
    error = _expected_error(np.abs(off), floor, ys, finer=2)
    kind, solver, other = names
    return Estimate(
        ts=ts,
        ys=solutions.result.ys,
        error=error,
        rounding=floor,
        scale=scales(scene, fine),
        fineness=np.array([solutions.tolerance[0], solutions.finer[0]]),
        kind=kind_of(kind, scene),
        solver=solver,
        other=other,
    )


def solve_to_digits(
    run: Run, scene: Scene, ts: Array, digits: float, solver: str, refuse: bool
) -> tuple[Any, Estimate]:
    """The solution with this many digits at all times, or the best one, and its estimate.

    The tolerance starts at the requested error and is tightened by the estimated miss.

    Args:
      run: solves a scene at a tolerance.
      scene: system, effects, start.
      ts: (s,) times of the computed states [s].
      digits: number of digits requested.
      solver: name of the method.
      refuse: raise where fewer digits, but some, are possible.
    Raises:
      ValueError: `digits` is not above 0 and at most 15, or, with `refuse`, more than
        the motion allows.
    """
    if _checks.is_traced((scene, ts, digits)):
        raise _checks.fail("digits", "numbers", "a traced value", "Pass rtol inside jit and grad.")
    _checks.check_digits(digits)
    wanted = 10.0**-digits
    names = ("tolerance ladder", solver, solver)
    floor = None
    rtol = min(wanted, _MAX_RTOL)
    for _ in range(_MAX_TRIES):
        rtol = max(rtol, FINEST)
        solutions = _three_solutions(run, run, scene, np.full(2, rtol))
        if floor is None:
            floor = _rounding_limit(run, scene, solutions, digits)
        result, found = solutions.result, _estimate(solutions, scene, ts, floor, names)
        missed = float(np.max((found.error + ROUNDING_MARGIN * floor) / found.scale)) / wanted
        beyond_limit = found.most_digits < digits
        if not (missed > 1 or beyond_limit) or rtol <= FINEST:
            break
        if beyond_limit:  # then the solution is to be accurate for as long as possible
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
    changes = [np.abs(gaps(scene, a, b)).max() for a, b in itertools.pairwise(ys)]
    with np.errstate(divide="ignore", invalid="ignore"):
        order = float(np.log2(changes[0] / changes[1]))
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
        if int(result.steps) >= _STEPS_RATIO * steps or fine[0] <= FINEST * _COARSENING:
            return ys, used
        fine = _tighten(fine)
    return (np.full_like(np.asarray(result.ys), np.nan), tolerance) if ys is None else (ys, used)


def _rounding_limit(
    run: Run, scene: Scene, solutions: _ThreeSolutions, digits: float
) -> np.ndarray:
    """(s, k) the effect of rounding on the states; one value for all `digits` near the limit.

    Two random perturbations determine it to a factor of ten or so, and it depends somewhat on the
    steps. Where that could decide whether the digits are possible, it is measured with more draws
    and at one tolerance for every number of digits, so that the limit is one number.
    """
    floor = rounding(run, scene, solutions.fine, solutions.finer)
    scale = scales(scene, solutions.fine)
    if digits_of(ROUNDING_MARGIN * np.max(floor / scale)) > digits + _NEAR_LIMIT_DIGITS:
        return floor
    fine, finer = _finer(run, scene, np.full(2, _LIMIT_RTOL), 0)
    return rounding(run, scene, fine, finer, draws=_DRAWS_AT_LIMIT)


def _expected_error(gap: np.ndarray, floor: np.ndarray, ys: np.ndarray, finer: int) -> np.ndarray:
    """(s, k) expected error of states `ys` that differ by `gap` from the mean of finer ones.

    All have rounding errors of root mean square `floor`; the states `ys` also have the error of
    their tolerance, whose size follows from the gap. The error of the states is their share of
    the gap plus a normal deviation, whose median is taken.
    """
    wide = gap > np.sqrt(1 + 1 / finer) * floor
    share = 1 - np.where(wide, (floor / np.where(wide, gap, 1.0)) ** 2 / finer, 1 / (finer + 1))
    error = np.hypot(share * gap, _NORMAL_MEDIAN * np.sqrt(share / finer) * floor)
    return np.maximum(error, storage_rounding(ys))
