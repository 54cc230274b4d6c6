"""The arguments of a search for an orbit, validated: a guess, bounds, closings, conditions."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, System
from jaxdyn._checks import array, fail, positive, shaped, untraced
from orbits.closing.closings import PLAIN, Closing
from orbits.closing.conditions import Condition, Hold, conditions
from orbits.closing.sizes import TIMES, alike, rate, sizes
from orbits.closing.symmetry import EXACT

_DIFFERENTIATE = (
    "Find the orbit outside of the transformation; orbits.differentiable(scene, orbit) has its "
    "derivatives by any number of the scene."
)
#: Distance from the start of a second state at which rates are compared, in units of the sizes.
_BESIDE = 1e-3
#: Of the rate that the sizes make in a radian of the span: smaller rates are rounding.
_ROUNDING = 1e-6

#: Of a rate, in units of the machine epsilon: changes up to this are its rounding.
_ROUNDINGS = 64.0


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
    if not isinstance(scene, Scene):
        raise fail("scene", "a Scene", type(scene).__name__, "Call it: scenes.three_body().")
    untraced("find", (scene, y0, period, lower, upper, hold), _DIFFERENTIATE)
    scene = scene if y0 is None else scene.starting(y0)
    scene.check()
    period = positive("period", scene.t1 if period is None else period, "It is a time.")
    array("period", period, (), "It is one time.")
    low, high = _bounds(len(scene.y0), lower, upper)
    guess = np.clip(np.append(np.asarray(scene.y0), float(period)), low, high)
    if not (np.isfinite(guess).all() and guess[-1] > 0):
        raise fail("bounds", "some finite numbers between them", f"{guess} nearest to the guess")
    scene = scene.starting(guess[:-1], guess[-1])
    depends_on_time = driven(scene)
    if depends_on_time:
        check_drive(scene, guess[-1])
    closings, held = _closings(scene, closing), conditions(scene, hold)
    for condition in held if type(scene.system).project is System.project else ():
        low, high = condition.fixed(guess, low, high)
    return Problem(
        scene=scene,
        closings=closings,
        conditions=held,
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
    now, later = (np.array(_rates(scene, t)) for t in (0.0, period))
    # Rates that are rounding have no size of their own.
    least = _ROUNDING * 2 * np.pi / float(scene.t1) * sizes(scene)
    size = np.maximum(alike(scene, np.abs(now).max(axis=0)), least)
    return bool((np.abs(now - later) <= EXACT * size).all())


def _rates(scene: Scene, later: float) -> list[np.ndarray]:
    """At several times, at the start and beside it: at rest the drive may cancel there alone."""
    y0 = np.asarray(scene.y0)
    beside = y0 + _BESIDE * sizes(scene) * (1 + np.arange(len(y0)))
    ts = later + float(scene.t1) * np.array(TIMES)
    at, off = ([np.asarray(rate(scene, t, y)) for t in ts] for y in (y0, beside))
    return at + off if np.isfinite(off).all() else at  # the scene may be undefined there


def drive(scene: Scene, y: Array, period: Array) -> Array:
    """(4 k,) the change of the rate over a period, zero where that is a multiple of the drive's."""
    ts = jnp.asarray(TIMES) * jax.lax.stop_gradient(period)
    now, later = (jax.vmap(scene.rate, (0, None))(t, y) for t in (ts, ts + period))
    varies = jax.lax.stop_gradient(jnp.abs(now - now[:1]).max(axis=0))
    # What varies by rounding only is no drive.
    rounding = _ROUNDINGS * jnp.finfo(float).eps * jnp.abs(now).max(axis=0)
    varies = jnp.where(varies > rounding, varies, jnp.inf)
    return ((later - now) / varies[None]).ravel()
