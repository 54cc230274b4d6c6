"""The arguments of a search for an orbit, validated: a guess, bounds, closings, conditions."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import array, fail, positive, shaped, untraced
from jaxdyn._records.kinds import check_kind
from orbits.closing.closings import PLAIN, Closing
from orbits.closing.conditions import Condition, Hold, conditions
from orbits.closing.symmetry import EXACT, rate

_DIFFERENTIATE = (
    "Find the orbit outside of the transformation; orbits.differentiable(scene, orbit) has its "
    "derivatives by any number of the scene."
)
#: Times, as fractions of the span, at which the rates of a scene are compared: no simple fractions
#: of each other, so that no drive has the same phase at all of them.
TIMES = (0.0, 0.13, 0.37, 0.71)
#: Distance from the start of a second state where they are compared, relative to its first entry.
_BESIDE = 1e-3


@dataclasses.dataclass(frozen=True)
class Problem:
    """A validated problem for `orbits.find`.

    Attributes:
      scene: the scene; it starts at the guess and spans the guessed period.
      closings: closing conditions; the orbit satisfies that with the smallest residual.
      conditions: further conditions besides closing.
      lower: (k + 1,) lower bounds of the start and the period.
      upper: (k + 1,) upper bounds; equal to the lower ones for entries that are held fixed.
      driven: whether the rate depends on time; the period is then a multiple of the drive's.
    """

    scene: Scene
    closings: tuple[Closing, ...]
    conditions: tuple[Condition, ...]
    lower: np.ndarray
    upper: np.ndarray
    driven: bool

    @property
    def guess(self) -> np.ndarray:
        """(k + 1,) guess of the start and the period, within the bounds."""
        return np.append(np.asarray(self.scene.y0), float(self.scene.t1))


def posed(
    scene: Scene,
    *,
    y0=None,
    period=None,
    lower=None,
    upper=None,
    closing: Closing | Sequence[Closing] = PLAIN,
    hold: Hold = (),
) -> Problem:
    """The problem that the arguments of `orbits.find` pose.

    Raises:
      ValueError: `scene` is not a Scene; an argument is traced, has another shape or is not
        finite; `period` is not positive, or not a multiple of the drive's; no number lies between
        `lower` and `upper`; a closing condition or a condition does not apply to the scene.
    """
    check_kind("scene", scene, (Scene,))
    untraced("find", (scene, y0, period, lower, upper, hold), _DIFFERENTIATE)
    scene = scene if y0 is None else scene.starting(y0)
    scene.check()
    closings = _closings(scene, closing)
    period = positive("period", scene.t1 if period is None else period, "It is a time.")
    array("period", period, (), "It is one time.")
    low, high = _bounds(len(scene.y0), lower, upper)
    guess = np.clip(np.append(np.asarray(scene.y0), float(period)), low, high)
    if not (np.isfinite(guess).all() and guess[-1] > 0):
        raise fail("bounds", "some finite numbers between them", f"{guess} nearest to the guess")
    depends_on_time = driven(scene)
    if depends_on_time:
        check_drive(scene, guess[-1])
    scene = scene.starting(guess[:-1], guess[-1])
    return Problem(
        scene=scene,
        closings=closings,
        conditions=conditions(scene, hold),
        lower=low,
        upper=high,
        driven=depends_on_time,
    )


def _closings(scene: Scene, closing: Closing | Sequence[Closing]) -> tuple[Closing, ...]:
    several = closing if isinstance(closing, list | tuple) else (closing,)
    if not several:
        raise fail("closing", "at least one closing condition", "none")
    closings = []
    for one in several:
        if not isinstance(one, Closing):
            remedy = "Such as orbits.PLAIN, orbits.choreography(3), orbits.relative()."
            raise fail("closing", "a Closing", repr(one), remedy)
        one.check_functions()
        one.check(scene)
        closings.append(one)
    return tuple(closings)


def _bounds(k: int, lower, upper) -> tuple[np.ndarray, np.ndarray]:
    low, high = _bound("lower", lower, k, -np.inf), _bound("upper", upper, k, np.inf)
    if (low > high).any():
        i = int(np.argmax(low > high))
        raise fail("lower", f"<= upper = {high[i]} at index {i}", low[i], "Swap them?")
    if not high[-1] > 0:
        raise fail("upper", "a positive last entry, for the period", high[-1])
    return low, high


def _bound(name: str, value, k: int, without: float) -> np.ndarray:
    if value is None:
        return np.full(k + 1, without)
    remedy = f"One entry for each of the {k} of the start, then one for the period."
    bound = np.array(shaped(name, value, (k + 1,), remedy))
    if np.isnan(bound).any():
        raise fail(name, "numbers", "NaN", "Use -inf or inf where there is no bound.")
    return bound


def driven(scene: Scene) -> bool:
    """Whether the rate depends on time."""
    rates = np.array(_rates(scene, 0.0)).reshape(-1, len(TIMES), len(scene.y0))
    return not np.array_equal(rates, np.broadcast_to(rates[:, :1], rates.shape), equal_nan=True)


def check_drive(scene: Scene, period: float) -> None:
    """Raise ValueError unless the rate repeats after the period.

    Where the rate depends on time, an orbit must close in the phase of the drive too.
    """
    if not repeats(scene, period):
        raise fail(
            "period",
            "a multiple of the drive's, since the rate depends on time",
            f"{period}, after which it does not repeat",
            "Give period=, to nine digits or more.",
        )


def repeats(scene: Scene, period: float) -> bool:
    """Whether the rate is the same after a period."""
    now, later = _rates(scene, 0.0), _rates(scene, period)
    size = max(float(np.abs(rate).max()) for rate in now)
    return all(np.abs(a - b).max() <= EXACT * size for a, b in zip(now, later, strict=True))


def _rates(scene: Scene, later: float) -> list[np.ndarray]:
    """At several times, at the start and beside it: at rest the drive may cancel there alone."""
    y0 = np.asarray(scene.y0)
    beside = y0 + _BESIDE * np.maximum(np.abs(y0), 1.0) * (1 + np.arange(len(y0)))
    ts = later + float(scene.t1) * np.array(TIMES)
    at, off = ([np.asarray(rate(scene, t, y)) for t in ts] for y in (y0, beside))
    return at + off if np.isfinite(off).all() else at  # the scene may be undefined there
