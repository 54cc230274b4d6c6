"""How far a solution is from the exact one: a finer solution beside it, and rounding.

A solution at a tolerance differs from one at a thousandth of it by its own error, but for a
thousandth. That is the whole estimate while the finer one is finer. Below that rounding rules, of
which two solutions may have the same share, so that their difference hides it. Its size is
measured apart: the motion is solved again with every step off a little, in the ninth digit, at
random (see `rounding`). What the states change by, scaled to half of the last digit, is what
rounding does, however it adds up on the way: on an orbit like the power 3/2 of the time, near an
unstable motion exponentially.

Here is the arithmetic, for anything that can be run at a tolerance; `accuracy` and
`simulate(digits=...)` are its users.
"""

import itertools
import warnings
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.scene import Scene
from jaxdyn.solvers.rounding import Noise

#: (scene, (2,) tolerance, noise of each step if any) -> what has `ys`, (s, k) states, NaN where
#: not reached.
Run = Callable[..., Any]
Names = tuple[str, str, str]

#: How much finer the second solution is. It is wrong by about as much less.
RATIO = 1e-3
MOST_DIGITS = 15
FINEST = 1e-16  # relative tolerance; below it steps only grow in number
_OTHER = 3.0  # ratio of tolerances that are as good but take other steps
_COARSER = 10.0  # where a tolerance is below what the scene allows
_COARSEST = 1e-2
_LEAST_ORDER = 0.5  # below it the steps are too large, or rounding is all there is
_TRIES = 5  # of tolerances for a wanted number of digits
_BELOW = 0.3  # of the wanted error to aim at, when a tolerance has missed it
_CHANGES = (1e-9, 1e-13, 1e-15)  # of each step, relative, to see what rounding does
_LINEAR = 0.1  # of the scale: motions farther apart have left each other
_MEDIAN = 0.6745  # of the size of a normal variable, in standard deviations
_SURE = (
    5.0  # spreads of two draws that a promised digit is away from rounding; 1 in 26 errs by more
)
_MORE = 1.3  # times the steps that a finer solution takes
_DRAWS = 2  # of random changes; with one, the effects of two steps may cancel
_EPS = float(np.finfo(float).eps)


class Estimate(eqx.Module):
    """How far a solution is from the exact one.

    Attributes:
      ts: (s,) times [s].
      ys: (s, k) the solution that it is about.
      error: (s, k) estimated absolute error of each entry, in its unit.
      rounding: (s, k) the part of it that no tolerance removes; NaN where not looked for.
      scale: (k,) what errors are measured by: the largest entry of the same unit. Angles are
        taken modulo a turn.
      kind: what the estimate rests on.
      solver: name of the method of the solution.
      other: name of the method of the second solution.
      wanted: () digits that were asked for, if any were.
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

    @property
    def relative(self) -> float:
        """Largest error over all times and entries, by scale; NaN if a run failed; host only."""
        return float(np.max(np.asarray(self.error) / np.asarray(self.scale)))

    @property
    def digits(self) -> float:
        """How many digits are right everywhere, 0 if none; NaN if a run failed; host only."""
        return _digits(self.relative)

    @property
    def most_digits(self) -> float:
        """How many digits doubles are sure to give this motion with any solver; host only."""
        return _digits(_SURE * np.max(np.asarray(self.rounding) / np.asarray(self.scale)))

    @property
    def basis(self) -> str:
        """What the estimate rests on, in words; host only."""
        mine, its = np.asarray(self.fineness)
        return f"{self.kind}: {self.solver} at {mine:.1e} against {self.other} at {its:.1e}"

    @property
    def shortfall(self) -> str:
        """What is missing to the digits asked for, and what to do; empty if nothing; host only."""
        sure = min(self.digits, self.most_digits)
        if self.wanted is None or not sure < self.wanted:
            return ""
        held = self.until(self.wanted)
        where = "at no sample" if np.isnan(held) else f"up to t = {held:.6g}"
        return (
            f"{self.wanted:g} digits were asked for; over the whole span {sure:.1f} are sure, all "
            f"of them {where}. Rounding is amplified to where no solver is sure to give more than "
            f"{self.most_digits:.1f}: shorten the span."
        )

    def until(self, digits: float) -> float:
        """Time up to which that many digits are sure; NaN if not even at the start; host only."""
        off = np.maximum(self.error, _SURE * np.nan_to_num(self.rounding))
        # Not >, or a run that failed, whose errors are NaN, would be right to its end.
        wrong = ~((off / np.asarray(self.scale)).max(axis=1) <= 10.0**-digits)
        first = int(np.argmax(wrong)) if wrong.any() else len(wrong)
        return float(self.ts[first - 1]) if first else float("nan")


def _digits(error) -> float:
    return max(0.0, -float(np.log10(error))) if np.isfinite(error) else float("nan")


def scales(scene: Scene, ys: np.ndarray) -> np.ndarray:
    """(k,) largest size, over times (s, k), of the entries with the same unit; 1 if all are 0."""
    sizes = np.abs(gaps(scene, ys, np.zeros_like(ys))).max(axis=0)
    units = [unit for _, unit in scene.system.labels()]
    of_unit = [max(s for s, u in zip(sizes, units, strict=True) if u == unit) for unit in units]
    return np.where(np.array(of_unit) == 0, 1.0, of_unit)


def gaps(scene: Scene, ys: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(s, k) differences of states as the system takes them."""
    plain = ys - others
    wrapped = np.asarray(_differences(scene.system, ys, others))
    # Wrapping an angle rounds it by 4e-16; where nothing is wrapped the plain one is exact.
    return np.where(np.abs(plain) <= 1.0, plain, wrapped)


@eqx.filter_jit
def _differences(system, ys, others):
    return jax.vmap(system.difference)(ys, others)


def measured(
    run: Run, scene: Scene, ts: Array, tolerance: np.ndarray, names: Names, by=None, floor=None
) -> tuple[Any, Estimate]:
    """The solution at a tolerance, and how far it is from a finer one and from rounding.

    Args:
      run: solves a scene at a tolerance.
      scene: system, effects, start.
      ts: (s,) times of the states that it finds [s].
      tolerance: (2,) relative and absolute.
      names: of the estimate, of the solver, and of the finer one's solver.
      by: runs the finer one; `run` if left out.
      floor: (s, k) the `rounding` of these states, where it is known.
    """
    by = by or run
    result = run(scene, tolerance)
    fine, finer = _finer(by, scene, tolerance, int(result.steps))
    floor = rounding(by, scene, fine, finer) if floor is None else floor
    ys, beside = np.asarray(result.ys), np.asarray(by(scene, _beside(finer)).ys)
    off = gaps(scene, ys, fine) + np.nan_to_num(0.5 * gaps(scene, fine, beside))
    error = _expected(np.abs(off), floor, ys, finer=2)
    pair = np.array([tolerance[0], finer[0]])
    return result, Estimate(ts, result.ys, error, floor, scales(scene, fine), pair, *names)


def reached(
    run: Run, scene: Scene, ts: Array, digits: float, solver: str, refuse: bool
) -> tuple[Any, Estimate]:
    """The solution with that many digits at all times, or the best, and its estimate.

    The tolerance starts at the wanted error and is tightened by as much as the estimate misses it.

    Args:
      run: solves a scene at a tolerance.
      scene: system, effects, start.
      ts: (s,) times of the states that it finds [s].
      digits: wanted.
      solver: what the method is called.
      refuse: raise where fewer digits, but some, are possible.
    Raises:
      ValueError: more digits than doubles can give.
    """
    if _checks.is_traced((scene, ts, digits)):
        raise _checks.fail("digits", "numbers", "a traced value", "Pass rtol inside jit and grad.")
    if not 0 < digits <= MOST_DIGITS:
        raise _checks.fail(
            "digits", f"between 1 and {MOST_DIGITS}", digits, "Doubles have not quite 16."
        )
    wanted = 10.0**-digits
    size, floor = 1.0, None
    rtol = min(wanted, _COARSEST)
    for _ in range(_TRIES):
        rtol = max(rtol, FINEST)
        tolerance = np.array([rtol, rtol * size])
        names = ("tolerance ladder", solver, solver)
        result, found = measured(run, scene, ts, tolerance, names, floor=floor)
        floor, least = found.rounding, float(np.min(found.scale))
        missed = float(np.max((found.error + _SURE * floor) / found.scale)) / wanted
        short = found.most_digits < digits
        # Entries that are small in their unit need an absolute tolerance as small.
        if not (missed > 1 or short) or (rtol <= FINEST and least >= size):
            break
        if short:  # as long as possible, then
            missed = max(missed, rtol / FINEST)
        size = min(size, least)
        rtol *= _BELOW / missed
    found = eqx.tree_at(lambda e: e.wanted, found, digits, is_leaf=lambda x: x is None)
    if found.shortfall:
        if refuse and 1 <= found.most_digits < digits:
            most = np.floor(10 * found.most_digits) / 10
            raise _checks.fail(
                "digits",
                f"at most {most:g} for this motion",
                digits,
                "Rounding alone moves it by more than that. Ask for fewer, or shorten the span.",
            )
        warnings.warn(found.shortfall, stacklevel=3)
    return result, found


def halved(run: Run, scene: Scene, ts: Array, h: float, name: str) -> Estimate:
    """How far a solution with equal steps h is from the exact one, from h / 2 and h / 4.

    Differences of the three show the order p; the first and the last differ by (1 - 4^-p) times
    the error of the first.
    """
    ys = [np.asarray(run(scene, np.array([h / n])).ys) for n in (1, 2, 4)]
    moved = [np.abs(gaps(scene, a, b)).max() for a, b in itertools.pairwise(ys)]
    with np.errstate(divide="ignore", invalid="ignore"):
        order = float(np.log2(moved[0] / moved[1]))
    falls = 1 - 4.0 ** -max(order, _LEAST_ORDER)
    floor = rounding(run, scene, ys[2], np.array([h / 4]))
    error = _expected(np.abs(gaps(scene, ys[0], ys[2])) / falls, floor, ys[0], finer=1)
    names = (f"step halving, order {order:.2g} seen", name, name)
    return Estimate(ts, ys[0], error, floor, scales(scene, ys[2]), np.array([h, h / 4]), *names)


def _tightened(tolerance: np.ndarray) -> np.ndarray:
    """A thousandth of the tolerance, its relative part not below the finest by a rounding.

    At the finest one beside it.
    """
    ratio = max(RATIO, FINEST / tolerance[0])
    return _beside(tolerance) if ratio > 0.5 else np.maximum(tolerance * ratio, [FINEST, 0.0])


def _beside(tolerance: np.ndarray) -> np.ndarray:
    """A third of the tolerance, or thrice the finest."""
    return tolerance * (1 / _OTHER if tolerance[0] > _OTHER * FINEST else _OTHER)


def _finer(
    run: Run, scene: Scene, tolerance: np.ndarray, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """(s, k) a solution finer than one of that many steps, NaN if none is, and its tolerance.

    A thousandth of the tolerance, or less where that takes hardly more steps, as it does where
    the span is shorter than the first step; or more where it is too little for the scene.
    """
    ys, fine = None, _tightened(tolerance)
    while True:
        result = run(scene, fine)
        if not np.isfinite(np.asarray(result.ys)).all():
            if ys is not None or fine[0] * _COARSER > tolerance[0]:
                break
            fine = fine * _COARSER
            continue
        ys, used = np.asarray(result.ys), fine
        if result.steps >= _MORE * steps or fine[0] <= FINEST * _COARSER:
            return ys, used
        fine = _tightened(fine)
    return (np.full_like(np.asarray(result.ys), np.nan), tolerance) if ys is None else (ys, used)


def rounding(run: Run, scene: Scene, ys: np.ndarray, tolerance: np.ndarray) -> np.ndarray:
    """(s, k) how far rounding moves the states `ys` that `run` finds at a tolerance.

    The root mean square of what random changes of each step move the states by, scaled from
    changes that are large enough to be seen down to half a spacing of doubles: at each time from
    the largest with which motions stay close. Where none do, no digit is certain: the scale itself.
    """
    scale = scales(scene, ys)
    found = np.broadcast_to(scale, ys.shape).copy()
    known = np.zeros(len(ys), bool)
    for size in _CHANGES:
        noises = [Noise(np.asarray(size), np.asarray(draw, np.uint64)) for draw in range(_DRAWS)]
        moved = [gaps(scene, np.asarray(run(scene, tolerance, noise).ys), ys) for noise in noises]
        spread = np.sqrt(np.mean(np.square(moved), axis=0))
        close = np.logical_and.accumulate((spread / scale <= _LINEAR).all(axis=1))
        new = close & ~known
        found[new] = 0.5 * _EPS / size * spread[new]
        known |= close
        if known.all():
            break
    return np.maximum(found, _written(ys))


def _written(ys: np.ndarray) -> np.ndarray:
    """(s, k) what writing a result down rounds it by."""
    return 0.5 * _EPS * np.abs(ys)


def _expected(gap: np.ndarray, floor: np.ndarray, ys: np.ndarray, finer: int) -> np.ndarray:
    """(s, k) expected size of the error of states `ys` that are a gap from the mean of finer ones.

    All have rounding errors of root mean square `floor`, the states in question that of the
    tolerance besides, of a size that the gap shows. The error of the states is its share of the
    gap, but for a normal deviation, of which the median counts.
    """
    wide = gap > np.sqrt(1 + 1 / finer) * floor
    share = 1 - np.where(wide, (floor / np.where(wide, gap, 1.0)) ** 2 / finer, 1 / (finer + 1))
    error = np.hypot(share * gap, _MEDIAN * np.sqrt(share / finer) * floor)
    return np.maximum(error, _written(ys))
