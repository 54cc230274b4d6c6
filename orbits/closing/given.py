"""What a search for an orbit is given: the guess, its bounds, and the time its scene depends on."""

from typing import NamedTuple

import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import array, fail, positive, untraced
from orbits.closing.closings import PLAIN, Closing
from orbits.closing.conditions import Condition, Hold
from orbits.closing.conditions import conditions as conditions_of
from orbits.closing.symmetry import EXACT, rate

_DIFFERENTIATE = (
    "Find the orbit outside of the transformation; then differentiate orbits.solution(scene, orbit)"
    " by any number of the scene."
)


class Given(NamedTuple):
    """What a search is given, checked.

    Attributes:
      guess: (k + 1,) start and period, within the bounds.
      lower: (k + 1,) bounds; the period of a driven scene is held.
      upper: (k + 1,)
      conditions: that must hold besides closing.
      driven: whether the rate depends on time.
    """

    guess: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    conditions: tuple[Condition, ...]
    driven: bool


def checked_guess(
    scene: Scene, y0=None, period=None, lower=None, upper=None, closings=(PLAIN,), hold: Hold = ()
) -> Given:
    """What a search is given; see `find`.

    Raises:
      ValueError: invalid or traced arguments.
    """
    if not isinstance(scene, Scene):
        raise fail("scene", "a Scene", type(scene).__name__, "Call it: scenes.three_body().")
    given = (scene, y0, period, lower, upper, hold)
    untraced("find", given, _DIFFERENTIATE)
    scene = scene if y0 is None else scene.starting(y0)
    scene.check()
    k = len(scene.y0)
    if not closings:
        raise fail("closing", "at least one closing condition", "none")
    for closing in closings:
        if not isinstance(closing, Closing):
            remedy = "orbits.PLAIN, orbits.choreography(3), orbits.relative() are some."
            raise fail("closing", "a Closing", repr(closing), remedy)
        closing.check(scene)
    period = positive("period", scene.t1 if period is None else period, "It is a time.")
    array("period", period, (), "It is one time.")
    guess = np.append(np.asarray(scene.y0), float(period))
    remedy = f"One entry for each of the {k} of the start, then one for the period."
    low = np.full(k + 1, -np.inf) if lower is None else _bound("lower", lower, k, remedy)
    high = np.full(k + 1, np.inf) if upper is None else _bound("upper", upper, k, remedy)
    if (low > high).any():
        i = int(np.argmax(low > high))
        raise fail("lower", f"<= upper = {high[i]} at index {i}", low[i], "Swap them?")
    if not high[-1] > 0:
        raise fail("upper", "a positive last entry, for the period", high[-1])
    clipped = np.clip(guess, low, high)
    if not (np.isfinite(clipped).all() and clipped[-1] > 0):
        raise fail("bounds", "some finite numbers between them", f"{clipped} nearest to the guess")
    drive = driven(scene)
    if drive:
        check_drive(scene, clipped[-1])
        low[-1] = high[-1] = clipped[-1]
    return Given(
        guess=clipped,
        lower=low,
        upper=high,
        conditions=conditions_of(scene.starting(clipped[:-1]), hold),
        driven=drive,
    )


def driven(scene: Scene) -> bool:
    """Whether the rate depends on time."""
    rates = _rates(scene, 0.0)
    return not all(np.array_equal(rates[0], rate, equal_nan=True) for rate in rates)


def check_drive(scene: Scene, period: float) -> None:
    """Raise ValueError unless the drive comes back after the period.

    Where the rate depends on time, the state's coming back is not enough.
    """
    now, later = _rates(scene, 0.0), _rates(scene, period)
    size = max(float(np.abs(rate).max()) for rate in now)
    if not all(np.abs(a - b).max() <= EXACT * size for a, b in zip(now, later, strict=True)):
        raise fail(
            "period",
            "a multiple of the drive's, since the rate depends on time",
            f"{period}, after which it does not repeat",
            "Give period=; it is held fixed.",
        )


def _rates(scene: Scene, later: float) -> list[np.ndarray]:
    ts = later + float(scene.t1) * np.array([0.0, 0.13, 0.37, 0.71])
    return [np.asarray(rate(scene, t, scene.y0)) for t in ts]


def _bound(name, value, k, remedy):
    try:
        value = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise fail(name, "numbers", repr(value), remedy) from error
    if value.shape != (k + 1,):
        raise fail(name, f"shape ({k + 1},)", f"shape {value.shape}", remedy)
    if np.isnan(value).any():
        raise fail(name, "numbers", "NaN", "Use -inf or inf where there is no bound.")
    return value
