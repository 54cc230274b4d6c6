"""The certain digits of a motion's final state, for anything that can be run again.

A motion is run again at a thousandth of its tolerance, and a third time with all numbers of its
scene also changed in their last digit. The changes of each entry of the end estimate its error: the
first shows the error of the tolerance, the difference of the two that of rounding. Where nearby
motions diverge so far that an entry has no certain digit, none is written. Motions that are far
apart may agree in an entry by chance; then it is compared with several, at other tolerances.

It is the cheap test of the end of a motion, one smooth piece or a chain of phases; `accuracy`
covers all times of a smooth motion and measures rounding more carefully.
"""

import dataclasses
import functools
import math
from collections.abc import Callable

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import as_float, check_first, check_on_host
from jaxdyn._doors import renamed
from jaxdyn.integrate.errors import FINEST, RATIO, gaps
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.simulation import RTOL
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.plan import plan_of
from jaxdyn.scales import Groups, groups, sizes_at_start
from jaxdyn.scene import Scene

Motion = Trajectory | HybridTrajectory
#: A function (scene, rtol) -> the motion of that scene at that tolerance.
Again = Callable[[Scene, float], Motion]

#: A digit is written if it is worth at least this many estimated errors: an estimate is within
#: this factor of the error (see `accuracy`).
_ESTIMATE_FACTOR = 5.0
#: An entry without a certain digit is written as 0 if its error is below this part of its scale.
_ZERO_BELOW = 1e-3
#: Part of the scale of an entry: where one is off by more, the finer motion may be lost as well, so
#: that other entries agree by chance only, as one in a hundred does to this part of its scale.
_APART = 0.01
#: Number of further motions that are compared then, each at twice the tolerance of the one before,
#: so that their steps differ. All agree in a lost entry by chance in 1 of 1e8 cases or fewer.
_MORE = 4
_LAST_DIGIT = 2.0**-52  # relative change of the numbers
_SEED = 0
_DOUBLE_DIGITS = 16  # significant digits of a double


@renamed(doubt="caveat")
@dataclasses.dataclass(frozen=True)
class EndError:
    """The estimated error of the final state of a motion.

    Attributes:
      y: (k,) the final state.
      error: (k,) estimated absolute error of each entry, in its unit; NaN where unknown.
      rounding: (k,) the part of it that no tolerance removes.
      scale: (k,) the reference of errors: the largest entry of the same unit in the motion, or the
        entry alone without a unit. For a rate it is at least what would change a quantity by its
        scale over the span, for an angle at least 1 rad.
      caveat: parts of the rate that neither this motion nor the others could detect, and the
        remedy; or empty.
    """

    y: np.ndarray
    error: np.ndarray
    rounding: np.ndarray
    scale: np.ndarray
    caveat: str = ""

    @property
    def digits(self) -> np.ndarray:
        """(k,) certain significant digits of each entry; NaN where unknown."""
        return _digits(self.error, np.abs(self.y))

    @property
    def least(self) -> float:
        """Certain digits of all entries, relative to their scale."""
        return float(np.min(_digits(self.error, self.scale)))

    @property
    def most(self) -> float:
        """The value of `least` at the finest tolerance."""
        return float(np.min(_digits(self.rounding, self.scale)))

    @property
    def message(self) -> str:
        """The number of certain digits and how to get more, as text."""
        if math.isnan(self.least):
            return (
                "No digit is certain: run again at a tighter tolerance, the motion does not reach "
                "this end, or reaches it through other phases."
            )
        if self.most < 1:
            return (
                "No digit is certain: rounding alone moves this end by its own size. Shorten the "
                "span; jaxdyn.accuracy.horizon.trusted_time says up to when digits can be trusted."
            )
        found = f"{self.least:.1f} digits are right, relative to the size of the motion"
        if self.most - self.least < 1:
            return f"{found}; no tolerance gives more. {self.caveat}".rstrip()
        return f"{found}; a smaller rtol gives up to {self.most:.1f}. {self.caveat}".rstrip()

    def written(self, most: int = 12) -> tuple[str, ...]:
        """Each entry with its certain digits, at most `most` significant ones.

        Example:
          >>> y, error = np.array([3.14159265, -7.3, 1e-17]), np.array([2e-5, 15.0, 3e-12])
          >>> EndError(y, error, error, np.ones(3)).written()
          ('3.1416', 'no digit left (+-2e+01)', '0 (+-3e-12)')
        """
        rows = zip(self.y, self.error, self.scale, strict=True)
        return tuple(
            _certain_digits(float(y), float(e), float(scale), most) for y, e, scale in rows
        )


@check_first
def end_error(motion: Motion, again: Again, *, rtol: float = RTOL) -> EndError:
    """The error of the final state of a motion, entry by entry; host only.

    Args:
      motion: one motion, or a chain of phases.
      again: runs a scene at a tolerance in the way this motion was run.
      rtol: tolerance of the motion.
    Returns:
      The estimate. Its errors are NaN where the motion or one of the two others did not reach the
      end, or where these went through other phases: then no digit is known to be correct.
    Raises:
      ValueError: `motion` is a batch.
    Limits: a chain is compared at its end alone, whatever phases are in between. A lost motion
      whose entries are all within a hundredth of their scale of a finer one's is taken as right.
    Example:
      >>> from jaxdyn import scenes, simulate
      >>> def again(scene, rtol):
      ...     return simulate(scene, samples=2, rtol=rtol)
      >>> end_error(again(scenes.oscillator(), 1e-6), again, rtol=1e-6).written()
      ('-0.83907153', '0.54402111')
    """
    check_on_host("motion", motion)
    scene, y = _end(motion)
    if not np.isfinite(y).all():
        nothing = np.full_like(y, np.nan)
        return EndError(y=y, error=nothing, rounding=nothing, scale=nothing)
    start = pieces_of(motion)[0].scene
    finer = max(rtol * RATIO, FINEST)
    other = perturb(start, _LAST_DIGIT, np.random.default_rng(_SEED))
    ends = [_same(motion, again(begin, finer)) for begin in (start, other)]
    spread, scale = _largest_gap(scene, ends[1], ends[:1]), _scales(motion, y)
    error = np.maximum(_largest_gap(scene, y, ends), spread)
    # The stored result is rounded as well.
    rounding = np.maximum(spread, 0.5 * np.finfo(float).eps * np.abs(y))
    if np.any(error > _APART * scale):
        more = [_same(motion, again(start, finer * 2.0**n)) for n in range(1, _MORE + 1)]
        error = np.maximum(error, _largest_gap(scene, y, more))
    caveat = plan_of(scene.field, len(scene.y0)).caveat
    return EndError(y=y, error=error, rounding=rounding, scale=scale, caveat=caveat)


def _largest_gap(scene: Scene, y: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
    """(k,) the largest distance of a state from several others, entry by entry."""
    return np.abs(gaps(scene, np.stack([y] * len(others)), np.stack(others))).max(axis=0)


def _scales(motion: Motion, y: np.ndarray) -> np.ndarray:
    """(k,) the scale of each entry, see `EndError`, from all samples of the motion and its end."""
    pieces = pieces_of(motion)
    labels = pieces[-1].scene.system.labels()
    # Phases may have different coordinates.
    alike = [piece for piece in pieces if piece.scene.system.labels() == labels]
    ys = np.concatenate([y[None], *(np.asarray(piece.ys) for piece in alike)])
    scene = pieces[-1].scene
    sizes = np.abs(gaps(scene, ys, np.zeros_like(ys))).max(axis=0)
    known = groups(scene.system)
    angles = np.isfinite(known.most)
    sizes = np.asarray(_largest(known, np.where(angles, np.maximum(sizes, 1.0), sizes)))
    # The scale of a rate is at least what would change a quantity by its size over the span.
    first, last = np.asarray(pieces[0].ts)[0], np.asarray(pieces[-1].ts)[-1]
    span = abs(float(last - first)) or math.inf
    of = {unit: size for (_, unit), size in zip(labels, sizes.tolist(), strict=True)}
    rates = [of.get(unit.removesuffix("/s"), 0.0) / span for _, unit in labels]
    sizes = np.where([unit.endswith("/s") for _, unit in labels], np.maximum(sizes, rates), sizes)
    # An entry that stays at 0 gets a size from the others.
    return np.where(sizes > 0, sizes, sizes_at_start(scene)) if (sizes == 0).any() else sizes


@functools.partial(jax.jit, static_argnums=0)  # one program, not one for each operation
def _largest(known: Groups, x: Array) -> Array:
    """(k,) the largest of each group of numbers x (k,)."""
    return known.largest(x)


@check_first
def perturb(scene: Scene, change: float, rng: np.random.Generator) -> Scene:
    """The scene with all its numbers and its start changed by a factor, up or down at random."""

    def nudge(x):
        factor = 1.0 + change * rng.choice([-1.0, 1.0], np.shape(x))
        return as_float(np.asarray(x) * factor)

    numbers, rest = eqx.partition(scene.field, eqx.is_inexact_array)
    field = eqx.combine(jax.tree.map(nudge, numbers), rest)
    other = dataclasses.replace(
        scene, system=field.system, effects=field.effects, y0=nudge(scene.y0)
    )
    return other.starting(other.field.project(as_float(0.0), other.y0))


def _end(motion: Motion) -> tuple[Scene, np.ndarray]:
    """The scene of the last piece and the state (k,) where it ended."""
    piece = pieces_of(motion)[-1]
    ended = isinstance(motion, HybridTrajectory) and motion.ended
    return piece.scene, np.asarray(motion.y) if ended else np.asarray(piece.ys)[-1]


def _same(motion: Motion, other: Motion) -> np.ndarray:
    """(k,) end of the other motion; NaN if it went through other phases."""
    _, y = _end(motion)
    names, others = (m.names if isinstance(m, HybridTrajectory) else () for m in (motion, other))
    return _end(other)[1] if names == others else np.full_like(y, np.nan)


def _digits(error: np.ndarray, size: np.ndarray) -> np.ndarray:
    size = np.where(size > 0, size, 1.0)
    found = -np.log10(np.maximum(error / size, np.finfo(float).eps))
    return np.where(_ESTIMATE_FACTOR * error < size, found, np.where(np.isnan(error), np.nan, 0.0))


def _certain_digits(value: float, error: float, scale: float, most: int) -> str:
    if not math.isfinite(value):
        return "not reached"
    if not math.isfinite(error):
        return "unknown"
    if error == 0:
        return f"{value:.{most}g}"
    large = math.floor(math.log10(abs(value))) if value else -math.inf
    sure = large - math.ceil(math.log10(_ESTIMATE_FACTOR * error)) + 1
    # Angles are compared modulo a turn: whole turns are unknown once parts of one differ.
    if sure > 0 and _ESTIMATE_FACTOR * error < scale:
        return f"{value:.{min(sure, most, _DOUBLE_DIGITS)}g}"
    return f"{'0' if error < _ZERO_BELOW * scale else 'no digit left'} (+-{error:.0e})"
