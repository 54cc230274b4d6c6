"""What is followed as parameters of a scene change: an orbit, a special point, or several of them.

Each has derivatives by the implicit function theorem, and is found again from their prediction.
"""

import abc
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import check_shape, check_untraced, fail
from jaxdyn._checks import numbers as floats
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.accuracy.timing import Clock
from jaxdyn.continuation import Equilibrium
from jaxdyn.continuation import sensitivity as points
from jaxdyn.continuation.kinds import Kind
from orbits.analysis.same import minimal_period
from orbits.analysis.sensitivity import (
    DifferentiableChain,
    DifferentiableOrbit,
    with_held_entries,
)
from orbits.analysis.stability import stability
from orbits.closing.closings import Hold
from orbits.closing.sizes import sizes
from orbits.families.family import Member
from orbits.families.relocation import find_again
from orbits.families.special_orbits import DifferentiableSpecialOrbit, SpecialOrbit
from orbits.hybrid.legs import HybridOrbit
from orbits.hybrid.phases import legs_of
from orbits.hybrid.search import find_hybrid
from orbits.orbit import Orbit, SearchError
from orbits.shooting.finding import find
from orbits.targets.derivatives import differentiable

#: Newton steps to find an orbit again: one that takes more is too far for its prediction.
_ITERATIONS = 30
_HALVINGS = 12  # of a step before a search gives up
#: A solution continues the known one if its distance from the prediction is at most `_OFF` times
#: the distance to the prediction, plus rounding. The latter counts as at least the relative step of
#: the parameters, but no more than `_LONG`: longer steps may lead to an orbit of another kind.
_OFF, _LONG, _ROUNDING = 0.25, 0.3, 1e-6

#: What can be followed.
Near = Orbit | HybridOrbit | Equilibrium | Member | SpecialOrbit
Make = Callable[[Array], Any]


class TimeLimit:
    """A limit of the computing time from now on, without compiling.

    It is checked before each search for the next orbit; a search that has begun is completed.
    """

    def __init__(self, seconds: float):
        if not seconds > 0:
            raise fail("seconds", "> 0", seconds, "It limits the time of the search.")
        self._clock, self._seconds = Clock(), seconds

    @property
    def over(self) -> bool:
        """Whether the time is up."""
        return self._clock.computing > self._seconds


@dataclasses.dataclass(frozen=True)
class Asked:
    """A function of what is followed.

    Attributes:
      name: the argument that gave the function, for messages.
      function: returns a number, or numbers (m,).
    """

    name: str
    function: Callable[[Any], Any]


class Followed(abc.ABC):
    """What is followed, as a function of the parameters (n,) of its scene."""

    @abc.abstractmethod
    def differentiable(self, numbers: Array, known: Any) -> Any:
        """The known solution with its derivatives."""

    @abc.abstractmethod
    def place(self, found: Any) -> Any:
        """The numbers of a differentiable solution by which the next one is predicted."""

    @abc.abstractmethod
    def again(self, before: np.ndarray, numbers: np.ndarray, known: Any, guess: Any) -> Any:
        """The solution for other parameters, from a guess of its `place`.

        Args:
          before: (n,) the parameters of the known solution.
          numbers: (n,) the other parameters.
          known: the known solution.
          guess: the guess.
        Raises:
          SearchError, ValueError: there is none near the guess.
        """

    def move(self, here: "At", numbers: np.ndarray, asked: Asked) -> "At | None":
        """The state at other parameters; None if none is found, or one without derivatives."""
        step = numbers - here.numbers
        guess = jax.tree.map(lambda x, slope: np.asarray(x + slope @ step), *here.places)
        try:
            new = self.at(numbers, self.again(here.numbers, numbers, here.found, guess), asked)
        except (SearchError, ValueError):
            return None
        off, ahead = (self.distance(here.found, guess, at.places[0]) for at in (new, here))
        scale = max(ahead, min(float(np.abs(step / here.units).max(initial=0.0)), _LONG))
        return new if off <= _OFF * scale + _ROUNDING else None

    def distance(self, known: Any, place: Any, other: Any) -> float:
        """The distance of two places, in the sizes of the known solution; 0 if it is ignored."""
        del known, place, other
        return 0.0

    def at(self, numbers: np.ndarray, found: Any, asked: Asked) -> "At":
        """What is followed at some parameters, and a function of it, with all derivatives."""

        def all_of(x: Array) -> tuple[Any, Any]:
            thing = self.differentiable(x, found)
            return jnp.atleast_1d(jnp.asarray(asked.function(thing), float)), self.place(thing)

        (value, place), (slopes, place_slopes) = value_and_jacfwd(all_of)(jnp.asarray(numbers))
        outside = "Call it outside jit, grad and vmap."
        check_untraced("make", place, outside)
        check_untraced(asked.name, value, outside)
        if value.ndim != 1:
            raise fail(asked.name, "a number or numbers (m,)", f"shape {value.shape}")
        value, slopes = np.asarray(value), np.asarray(slopes)
        if not (np.isfinite(value).all() and np.isfinite(slopes).all()):
            remedy = "A multiplier that meets another one has no derivative; see orbits.stability."
            raise fail(
                asked.name, "finite numbers with derivatives", "NaN or infinite ones", remedy
            )
        return At(numbers, found, value, slopes, (place, place_slopes))


@dataclasses.dataclass(frozen=True)
class At:
    """What is followed, at some parameters.

    Attributes:
      numbers: (n,) the parameters.
      found: what is followed.
      value: (m,) a function of it.
      slopes: (m, n) the derivatives of that.
      places: what predicts it for other parameters, and the derivatives of that.
    """

    numbers: np.ndarray
    found: Any
    value: np.ndarray
    slopes: np.ndarray
    places: tuple[Any, Any]

    @property
    def units(self) -> np.ndarray:
        """(n,) the sizes of the parameters; of one that is 0, the change that cancels `value`."""
        slope, value = np.abs(self.slopes).max(axis=0, initial=0.0), np.abs(self.value).max()
        known = (slope > 0) & (value > 0)
        by_slope = np.where(known, value / np.where(slope > 0, slope, 1.0), 1.0)
        return np.where(self.numbers != 0, np.abs(self.numbers), by_slope)


@dataclasses.dataclass(frozen=True)
class Search(abc.ABC):
    """A search within bounds, whose steps are halved until one is accepted."""

    followed: Followed
    asked: Asked
    low: np.ndarray
    high: np.ndarray
    goal: float
    limit: TimeLimit

    @abc.abstractmethod
    def accepts(self, here: At, new: At) -> bool:
        """Whether a new state is so much better that the step is taken."""

    def shorten(self, here: At, step: np.ndarray) -> At | None:
        """The state after a step, or after a part of it; None if none is accepted in time."""
        for _ in range(_HALVINGS):
            if self.limit.over:
                break
            numbers = np.clip(here.numbers + step, self.low, self.high)
            new = self.followed.move(here, numbers, self.asked)
            if new is not None and self.accepts(here, new):
                return new
            step = 0.5 * step
        return None


def follow(make: Make, near: Near | Sequence[Near], hold: Hold) -> tuple[Followed, Any]:
    """What is followed, and where it begins.

    Raises:
      ValueError: it can not be followed.
    """
    if isinstance(near, list | tuple):
        if not near:
            raise fail("near", "at least one orbit or special point", "none")
        each, known = zip(*(follow(make, one, hold) for one in near), strict=True)
        return _Several(each), known
    if isinstance(near, Orbit | HybridOrbit):
        if not near.ok:
            raise fail("near", "an orbit that closes", near.message, "find() one first.")
        if isinstance(near, Orbit):
            return _OfOrbits(make, hold), near
        if hold:
            raise fail("hold", "none for a chain of legs", "conditions", "Leave it out.")
        return _OfChains(make, ()), near
    if isinstance(near, Equilibrium):
        return _OfEquilibria(make, ()), near
    if isinstance(near, Member | SpecialOrbit):
        return _OfSpecialOrbits(make, hold), SpecialOrbit.of(near)
    expected = "an orbit, or a special point of a family"
    raise fail("near", expected, type(near).__name__, "See family.special.")


def is_in_family(found: Any) -> bool:
    """Whether an orbit, or one of several, has neighbours of other values of an integral."""
    if isinstance(found, tuple):
        return any(map(is_in_family, found))
    return isinstance(found, Orbit) and stability(found).integrals > 0


@dataclasses.dataclass(frozen=True)
class _One(Followed):
    """A single orbit, chain of legs or special point.

    Attributes:
      make: returns what `orbits.differentiable` takes.
      hold: its conditions.
    """

    make: Callable[[Array], Any]
    hold: Hold

    def differentiable(self, numbers, known):
        return differentiable(self.make(numbers), known, hold=self.hold)


class _OfOrbits(_One):
    """An orbit; `make` returns its scene."""

    def place(self, found: DifferentiableOrbit):
        return found.y0, found.period

    def distance(self, known: Orbit, place, other):
        return _distance(known.scene, known.period, place, other)

    def again(self, before, numbers, known: Orbit, guess):
        y0, period = guess
        old, scene = (self.make(jnp.asarray(x)) for x in (before, numbers))
        found = find(
            scene,
            with_held_entries(y0, known, self.hold, old, scene),
            period,
            closing=known.closing,
            hold=self.hold,
            rtol=known.rtol,
            max_iterations=_ITERATIONS,
        )
        _check_turns(known, found)
        return found


class _OfChains(_One):
    """A chain of legs; `make` returns its legs, or the phases from which it was found."""

    def place(self, found: DifferentiableChain):
        return found.y0, found.spans

    def distance(self, known: HybridOrbit, place, other):
        return _distance(known.legs[0].scene, known.period, place, other)

    def again(self, before, numbers, known: HybridOrbit, guess):
        del before
        y0, spans = guess
        legs = legs_of(self.make(jnp.asarray(numbers)), known.path)
        found = find_hybrid(
            legs, y0, spans, closes=known.closes, rtol=known.rtol, max_iterations=_ITERATIONS
        )
        _check_turns(known, found)
        return dataclasses.replace(found, path=known.path)


class _OfEquilibria(_One):
    """A special point of equilibria; `make` returns a function from the parameter to a scene."""

    def place(self, found: points.DifferentiablePoint):
        return found.state, found.parameter

    def again(self, before, numbers, known: Equilibrium, guess):
        del before
        state, parameter = guess
        return points.find_again(self.make(jnp.asarray(numbers)), known, state, float(parameter))


class _OfSpecialOrbits(_One):
    """A special orbit; `make` returns a function from the parameter to a scene, or a scene."""

    def place(self, found: DifferentiableSpecialOrbit):
        if found.known.kind == Kind.FOLD:  # it is found again from the known one
            orbit = found.known.orbit
            return found.parameter, jnp.asarray(orbit.y0), jnp.asarray(orbit.period)
        orbit = found.orbit
        return found.parameter, orbit.y0, orbit.period

    def again(self, before, numbers, known: SpecialOrbit, guess):
        del before
        parameter, y0, period = guess
        made = self.make(jnp.asarray(numbers))
        found = find_again(known, made, float(parameter), (y0, float(period)), hold=self.hold)
        _check_turns(known.orbit, found.orbit)
        return found


def _distance(scene: Scene, period: float, place: tuple, other: tuple) -> float:
    """The distance of two starts and durations, in the sizes of a scene and the period."""
    start, times = (
        np.abs(np.asarray(a) - np.asarray(b)) for a, b in zip(place, other, strict=True)
    )
    return max(float(np.max(start / sizes(scene))), float(np.max(times)) / period)


def _check_turns(known: Orbit | HybridOrbit, found: Orbit | HybridOrbit) -> None:
    """Raise SearchError unless both periods are the same multiple of the minimal period.

    Two periods of an orbit close as well, and after a long step they may be nearer to the
    prediction than one period.
    """
    before, after = (minimal_period(orbit)[1] for orbit in (known, found))
    if before != after:
        raise SearchError(f"The orbit goes round {after} times, the known one {before}.")


@dataclasses.dataclass(frozen=True)
class _Several(Followed):
    """Several of them, which need not be of the same kind."""

    each: tuple[Followed, ...]

    def differentiable(self, numbers, known):
        pairs = zip(self.each, known, strict=True)
        return tuple(one.differentiable(numbers, thing) for one, thing in pairs)

    def place(self, found):
        return tuple(one.place(thing) for one, thing in zip(self.each, found, strict=True))

    def distance(self, known, place, other):
        every = zip(self.each, known, place, other, strict=True)
        return max(one.distance(thing, a, b) for one, thing, a, b in every)

    def again(self, before, numbers, known, guess):
        every = zip(self.each, known, guess, strict=True)
        return tuple(one.again(before, numbers, thing, place) for one, thing, place in every)


def bounds(lower, upper, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) lower and upper bounds of parameters; infinite where none are given.

    Raises:
      ValueError: the parameters are not within them, or there are more or fewer.
    """
    low = _bound("lower", lower, -np.inf, numbers.shape)
    high = _bound("upper", upper, np.inf, numbers.shape)
    if not ((low <= numbers) & (numbers <= high)).all():
        raise fail("guess", "within its bounds", numbers.tolist(), "See lower and upper.")
    return low, high


def _bound(name: str, given: Any, none: float, shape: tuple[int, ...]) -> np.ndarray:
    if given is None:
        return np.full(shape, none)
    check_untraced(name, given)
    bound = np.asarray(floats(name, given))
    if bound.shape:
        check_shape(name, bound.shape, shape)
    return np.broadcast_to(bound, shape)
