"""How far a solution is from the exact one: a finer solution beside it, and rounding.

A solution at a tolerance differs from one at a thousandth of it by its own error, but for a
thousandth. That is the whole estimate while the finer one is finer. Below that rounding rules,
which all solutions share in part (the numbers of the scene are rounded once for all of them), so
a difference may hide it. Its size is measured apart: the scene is solved again with all of its
numbers changed a little, in their ninth digit, at random. What the states change by, scaled to
the last digit, is what rounding does.

Here is the arithmetic, for anything that can be run at a tolerance; `accuracy` and
`simulate(digits=...)` are its users.
"""

import itertools
import warnings
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.scene import Scene

#: (scene, (2,) tolerance) -> what has `ys`, (s, k) states, NaN where not reached.
Run = Callable[[Scene, np.ndarray], Any]
Names = tuple[str, str, str]

#: How much finer the second solution is. It is wrong by about as much less.
RATIO = 1e-3
MOST_DIGITS = 15
FINEST = 1e-16  # relative tolerance; below it steps only grow in number
_COARSER = 10.0  # where a tolerance is below what the scene allows
_COARSEST = 1e-2
_LEAST_ORDER = 0.5  # below it the steps are too large, or rounding is all there is
_TRIES = 5  # of tolerances for a wanted number of digits
_BELOW = 0.3  # of the wanted error to aim at, when a tolerance has missed it
_CHANGES = (1e-9, 1e-13)  # of the numbers, relative, to see what rounding does
_LINEAR = 1e-2  # of the scale: motions farther apart have left each other
_ROUNDED = 0.2  # spacings of doubles that rounding changes each number by; see `rounding`
_MORE = 1.3  # times the steps that a finer solution takes
_DRAWS = 2  # of random signs; with one, two effects may cancel
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
        """How many digits doubles can give this motion with any solver; host only."""
        return _digits(np.max(np.asarray(self.rounding) / np.asarray(self.scale)))

    @property
    def basis(self) -> str:
        """What the estimate rests on, in words; host only."""
        mine, its = np.asarray(self.fineness)
        return f"{self.kind}: {self.solver} at {mine:.1e} against {self.other} at {its:.1e}"

    @property
    def shortfall(self) -> str:
        """What is missing to the digits asked for, and what to do; empty if nothing; host only."""
        if self.wanted is None or not self.digits < self.wanted:
            return ""
        return (
            f"{self.wanted:g} digits were asked for; over the whole span {self.digits:.1f} are "
            f"right, up to t = {self.until(self.wanted):.6g} all of them. Rounding is amplified "
            f"to where no solver gives more than {self.most_digits:.1f}: shorten the span."
        )

    def until(self, digits: float) -> float:
        """Time up to which that many digits are right; NaN if not even at the start; host only."""
        # Not >, or a run that failed, whose errors are NaN, would be right to its end.
        wrong = ~((np.asarray(self.error) / np.asarray(self.scale)).max(axis=1) <= 10.0**-digits)
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
    error = np.maximum(np.abs(gaps(scene, np.asarray(result.ys), fine)), floor)
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
        floor, least, missed = found.rounding, float(np.min(found.scale)), found.relative / wanted
        # Entries that are small in their unit need an absolute tolerance as small.
        if not missed > 1 or (rtol <= FINEST and least >= size):
            break
        if found.most_digits < digits:  # as long as possible, then
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
    error = np.maximum(np.abs(gaps(scene, ys[0], ys[2])) / falls, floor)
    names = (f"step halving, order {order:.2g} seen", name, name)
    return Estimate(ts, ys[0], error, floor, scales(scene, ys[2]), np.array([h, h / 4]), *names)


def _tightened(tolerance: np.ndarray) -> np.ndarray:
    """A thousandth of the tolerance, its relative part not below the finest by a rounding."""
    tighter = tolerance * max(RATIO, FINEST / tolerance[0])
    return np.maximum(tighter, [FINEST, 0.0])


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

    The change of the states when each number of the scene is changed by a fifth of the spacing of
    doubles, from two random changes that are large enough to be seen. The steps are summed with
    compensation, so it is the rates that are rounded, each a little differently; with a fifth the
    median of the scenes with exact solutions comes out right. Where motions with changes of 1e-13
    leave each other no digit is certain: the scale itself from there on.
    """
    scale = scales(scene, ys)
    moved, left = np.zeros_like(ys), np.zeros((len(ys), 1), bool)
    for change in _CHANGES:
        moved = np.zeros_like(ys)
        for draw in range(_DRAWS):
            other = changed(scene, change, np.random.default_rng(draw))
            gap = np.abs(gaps(scene, np.asarray(run(other, tolerance).ys), ys))
            moved = np.fmax(moved, gap)  # a changed scene that cannot be run says nothing
        left = np.maximum.accumulate(moved / scale > _LINEAR).any(axis=1, keepdims=True)
        moved = _ROUNDED * _EPS / change * moved
        if not left.any():
            break
    least = 0.5 * np.abs(ys) * _EPS  # of writing a result down
    return np.where(left, scale, np.maximum(moved, least))


def changed(scene: Scene, change: float, rng: np.random.Generator) -> Scene:
    """The scene with each of its numbers and its start changed by a part, up or down at random."""

    def nudge(x):
        factor = 1.0 + change * rng.choice([-1.0, 1.0], np.shape(x))
        # A Python number keeps the kind of a single number, for which all is compiled.
        return jnp.asarray(x) * (factor if np.ndim(x) else float(factor))

    numbers, rest = eqx.partition(scene.field, eqx.is_inexact_array)
    field = eqx.combine(jax.tree.map(nudge, numbers), rest)
    other = Scene(field.system, field.effects, y0=nudge(scene.y0), t1=scene.t1)
    return other.starting(other.field.project(jnp.zeros(()), other.y0))
