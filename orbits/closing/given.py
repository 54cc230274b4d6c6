"""The arguments of a search for an orbit, validated: a guess, bounds, closings, conditions."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, System
from jaxdyn._checks import array, array_of_shape, check_on_host, fail, positive
from jaxdyn.plan import plan_of
from jaxdyn.plan.plan import without_wrappers
from jaxdyn.scene import check_scene
from orbits.closing.closings import EXACT, PLAIN, Closing, Condition, Hold, conditions
from orbits.closing.sizes import PHASES, SPREAD, alike, rates_at, sizes

DIFFERENTIATE = (
    "Find the orbit outside of the transformation; orbits.differentiable(scene, orbit) has its "
    "derivatives by any number of the scene."
)
#: Distance from the start of a second state at which rates are compared, in units of the sizes.
_BESIDE = 1e-3
#: A guess within this share of the drive's period of a multiple of it stands for that multiple.
_NEAR = 0.25
#: Rates below this share of the sizes per radian of the span are rounding.
_ROUNDING = 1e-6
#: A condition on time repeats if its change over a period is at most this share of that within one.
_REPEATS = 0.1
#: Relative changes of a rate up to this, in units of the machine epsilon, are rounding.
_RATE_ROUNDINGS = 64.0


@dataclasses.dataclass(frozen=True)
class Problem:
    """A validated problem for `orbits.find`.

    Attributes:
      scene: the scene; it starts at the guess and spans the guessed period.
      closings: closing conditions; the orbit satisfies the one with the smallest residual.
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


def pose(
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
      ValueError: `scene` is not a `Scene`; an argument is traced, has another shape or is not
        finite; `period` is not positive, or not a multiple of the drive's; no number lies between
        `lower` and `upper`; a closing condition or a condition does not apply to the scene.
    """
    check_on_host("find", (scene, y0, period, lower, upper, hold), DIFFERENTIATE)
    scene = check_scene(scene if y0 is None else scene.starting(y0))
    period = positive("period", scene.t1 if period is None else period, "It is a time.")
    array("period", period, (), "It is one time.")
    low, high = _bounds(len(scene.y0), lower, upper)
    guess = np.clip(np.append(np.asarray(scene.y0), float(period)), low, high)
    if not (np.isfinite(guess).all() and guess[-1] > 0):
        raise fail("bounds", "some finite numbers between them", f"{guess} nearest to the guess")
    scene = scene.starting(guess[:-1], guess[-1])
    depends_on_time = is_driven(scene)
    if depends_on_time:
        guess[-1] = in_step(scene, float(guess[-1]))
        if not low[-1] <= guess[-1] <= high[-1]:
            wanted = f"bounds of the period around {guess[-1]:.15g}, a multiple of the drive's"
            raise fail("bounds", wanted, f"{low[-1]} to {high[-1]}")
        scene = scene.starting(scene.y0, guess[-1])
        if drive_period(scene) is not None:
            low[-1] = high[-1] = guess[-1]
    closings = _closings(scene, closing)
    held = conditions(scene, hold, closings)
    for condition in () if has_constraints(scene) else held:
        low, high = condition.fix(guess, low, high)
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
        one.check_functions()
        one.check(scene)
        closings.append(one.fit_to(scene))
    return tuple(closings)


def _bounds(k: int, lower, upper) -> tuple[np.ndarray, np.ndarray]:
    low, high = _limits("lower", lower, k, -np.inf), _limits("upper", upper, k, np.inf)
    if (low > high).any():
        i = int(np.argmax(low > high))
        raise fail("lower", f"<= upper = {high[i]} at index {i}", low[i], "Swap them?")
    if not high[-1] > 0:
        raise fail("upper", "a positive last entry, for the period", high[-1])
    return low, high


def _limits(name: str, value, k: int, without: float) -> np.ndarray:
    if value is None:
        return np.full(k + 1, without)
    remedy = f"One entry for each of the {k} of the start, then one for the period."
    bound = np.array(array_of_shape(name, value, (k + 1,), remedy))
    if np.isnan(bound).any():
        raise fail(name, "numbers", "NaN", "Use -inf or inf where there is no bound.")
    return bound


def is_driven(scene: Scene) -> bool:
    """Whether the rate depends on time; False is proved from the program of the rate."""
    return plan_of(scene.field, len(scene.y0)).depends_on_time


def has_constraints(scene: Scene) -> bool:
    """Whether states are projected onto constraints."""
    return type(scene.system).project is not System.project


def refuse_constraints(name: str, scene: Scene) -> None:
    """Raise ValueError for a scene with constraints."""
    if has_constraints(scene):
        remedy = "Use a minimal set of coordinates."
        raise fail(name, "a scene without constraints", "one with them", remedy)


def in_step(scene: Scene, period: float) -> float:
    """The multiple of the drive's period that a guess of an orbit's period stands for.

    Where the rate depends on time, the phase of the drive must close too.

    Raises:
      ValueError: the guess lies between two multiples; or the drive's period cannot be read from
        the program of the rate, and the rate does not repeat after the guess.
    """
    drive = drive_period(scene)
    if drive is None:
        check_drive(scene, period)
        return period
    turns = turns_in(period, drive)
    if not turns:
        near = f"{max(round(period / drive), 1) * drive:.15g}"
        got = f"{period}, between two of them"
        raise fail("period", f"a multiple of the drive's, {drive:.15g}", got, f"Say {near}?")
    return turns * drive


def turns_in(period: float, drive: float) -> int:
    """How many periods of a drive fit into a period; 0 if it lies between two multiples."""
    turns = max(round(period / drive), 1)
    return turns if abs(period - turns * drive) <= _NEAR * drive else 0


def drive_period(scene: Scene) -> float | None:
    """The period of the rate in time; None where none can be read from its program."""
    return plan_of(scene.field, len(scene.y0)).period(scene.field)


def check_drive(scene: Scene, period: float) -> None:
    """Raise ValueError unless the rate repeats after the period."""
    if not repeats(scene, period):
        drive = drive_period(scene)
        wanted = "a multiple of the drive's, since the rate depends on time"
        raise fail(
            "period",
            wanted if drive is None else f"{wanted}: {drive:.15g}",
            f"{period}, after which it does not repeat",
            "Give period=, to nine digits or more.",
        )


def repeats(scene: Scene, period: float) -> bool:
    """Whether the rate is the same after a period."""
    drive = drive_period(scene)
    if drive is not None:
        turns = period / drive
        return round(turns) >= 1 and abs(turns - round(turns)) <= EXACT * turns
    now, later = (_rates(scene, t, period) for t in (0.0, period))
    # Rates that are rounding have no size of their own.
    least = _ROUNDING * 2 * np.pi / float(scene.t1) * sizes(scene)
    size = np.maximum(alike(scene, np.abs(now).max(axis=0)), least)
    return bool((np.abs(now - later) <= EXACT * size).all())


def loses_drive(scene: Scene, period: float) -> bool:
    """Whether the drive of an orbit is rounding error of the rate, so that any period closes.

    It becomes so where its amplitude tends to zero, or the motion to infinity.
    """
    if drive_period(scene) is not None:
        return not repeats(scene, period)
    y, away = np.asarray(scene.y0), beside(scene)
    rates = np.asarray(rates_at(scene, period * SPREAD, y if away is None else y + away))
    return not np.ptp(rates, axis=0).any()


def _rates(scene: Scene, later: float, period: float) -> np.ndarray:
    """(n, k) rates at many times, at the start and beside it: at rest the drive may cancel."""
    y0, away = np.asarray(scene.y0), beside(scene)
    ts = later + period * SPREAD
    at, off = (np.asarray(rates_at(scene, ts, y)) for y in (y0, y0 if away is None else y0 + away))
    # The rate beside the start may be undefined.
    return np.concatenate([at, off] if np.isfinite(off).all() else [at])


def beside(scene: Scene) -> np.ndarray | None:
    """(k,) the offset from a scene's start at which its drive is read; None without a drive."""
    if not is_driven(scene):
        return None
    return _BESIDE * sizes(scene) * (1 + np.arange(len(scene.y0)))


def drive(scene: Scene, y: Array, period: Array, away: Array) -> Array:
    """(4 k,) the change of the rate over a period, zero if that is a multiple of the drive's.

    It is taken at the phases at which the rate changes fastest, since a drive may act for a small
    part of its period. The rate of a switched drive may also be the same after other times, so the
    change of the margins of its switches is added. The rate is read at an offset `away` (k,) from
    y, since at y itself the drive may cancel, as a parametric one does at rest, and then any period
    would do; where it is undefined there, it is read at y.
    """
    # The derivative by y is left out: it is zero where the rate repeats. Elsewhere it would turn an
    # exact state of rest into one of 1e-17, then of 1e-34, each with sizes of its own.
    known, y = jax.lax.stop_gradient((period, y))
    many = known * jnp.asarray(SPREAD)
    defined = jnp.isfinite(jax.vmap(scene.rate, (0, None))(many, y + away)).all()
    y = y + jnp.where(defined, away, 0.0)

    def value_and_speed(t):
        return jax.jvp(lambda t: scene.rate(t, y), (t,), (jnp.ones_like(t),))

    values, speeds = jax.vmap(value_and_speed)(many)
    fast = jnp.abs(speeds)
    most = jnp.maximum(fast.max(axis=0), jnp.finfo(float).tiny)
    fast = (fast / most[None]).sum(axis=1)
    ts = jax.lax.stop_gradient(many[jax.lax.top_k(fast, PHASES)[1]])
    now, later = (jax.vmap(scene.rate, (0, None))(t, y) for t in (ts, ts + period))
    # The range over the whole period: at the fastest phases of a sine its values are almost equal.
    varies = jax.lax.stop_gradient(jnp.ptp(values, axis=0))
    # A rate that varies only by rounding is not driven.
    rounding = _RATE_ROUNDINGS * jnp.finfo(float).eps * jnp.abs(values).max(axis=0)
    varies = jnp.where(varies > rounding, varies, jnp.inf)
    return ((later - now) / varies[None] + _switches(scene, ts, period)[:, None]).ravel()


def _switches(scene: Scene, ts: Array, period: Array) -> Array:
    """(p,) the change over a period of the margins of conditions on time, summed over these.

    Conditions that do not nearly repeat are left out, such as one on the time a drive begins.
    """
    plan = plan_of(scene.field, len(scene.y0))
    if not plan.of_time.any():
        return jnp.zeros_like(ts)
    field = without_wrappers(scene.field)

    def margins(t):
        return plan.time_conditions(field, t, None).margins

    now, later = (jax.vmap(margins)(t) for t in (ts, ts + period))
    within = jax.vmap(margins)(jax.lax.stop_gradient(period) * jnp.asarray(SPREAD))
    size = jax.lax.stop_gradient(jnp.ptp(within, axis=0))
    off = jax.lax.stop_gradient(jnp.abs(later - now).max(axis=0))
    change = (later - now) / jnp.where(size > 0, size, 1.0)[None]
    return jnp.where((off < _REPEATS * size)[None], change, 0.0).sum(axis=1)
