"""The search for piecewise-smooth periodic motions: closed chains of smooth legs.

It applies Newton's method to the equations of `equations`, in units.
"""

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import check_on_host, fail
from jaxdyn._text import number_of
from jaxdyn.integrate.events import Event
from jaxdyn.plan import plan_of
from jaxdyn.scene import Scene, check_scene
from orbits.closing.given import is_driven
from orbits.hybrid.equations import ChainEquations
from orbits.hybrid.legs import HybridOrbit, Leg, Path
from orbits.hybrid.phases import Phases, follow, legs_of
from orbits.orbit import Outcome, SearchError
from orbits.shooting import newton
from orbits.shooting.deflation import SAME, Deflated, DeflatedNewton
from orbits.shooting.multiple import Shooting
from orbits.shooting.strategy import GOAL, RTOL, SECONDS, Effort

# ---- Distances of chains of legs from known ones, for deflation
#
# A known chain may begin at the start of any of its legs, and be run through once or twice.

_TIMES = (1, 2)  # numbers of periods of a known chain


class Squares:
    """x (u,) -> the square of its distance from each known chain, and that square's gradient."""

    def __init__(self, chain: ChainEquations, known: Sequence[HybridOrbit], sizes: np.ndarray):
        """Measure in sizes (k,) of the first state, and in known periods.

        Raises:
          ValueError: one of the known chains does not close, or is of other scenes.
        """
        self._chain, self._sizes = chain, sizes
        scene = chain.legs[0].scene
        self._system = scene.system
        self._known = []
        for one in known:
            if not (isinstance(one, HybridOrbit) and one.ok):
                got = getattr(one, "message", type(one).__name__)
                raise fail("Deflated", "known chains of legs that close", got)
            legs = [leg.scene for leg in one.legs]
            starts = [np.asarray(x.y0) for x in legs if type(x.system) is type(scene.system)]
            starts = [y for y in starts if y.shape == scene.y0.shape]
            if not starts:
                raise fail("Deflated", f"known chains of {scene!r}", repr(one.legs[0].scene))
            self._known.append((starts, one.period))

    def __call__(self, x: np.ndarray) -> list[tuple[float, np.ndarray]]:
        return [self._nearest(x, *one) for one in self._known]

    def distance(self, x: np.ndarray) -> float:
        """Distance of x (u,) from the nearest known chain."""
        return min(float(np.sqrt(square)) for square, _ in self(x))

    def _nearest(self, x, starts: list[np.ndarray], period: float) -> tuple[float, np.ndarray]:
        start, spans, _ = self._chain.unpack(x)
        found = []
        for y in starts:
            off = np.asarray(self._system.difference(start, y)) / self._sizes
            for times in _TIMES:
                longer = spans.sum() / (times * period) - 1.0
                by_span = np.full(len(spans), 2 * longer / (times * period))
                slope = self._chain.pack(2 * off / self._sizes, by_span)
                found.append((float(off @ off) + longer**2, slope))
        square, slope = min(found, key=lambda one: one[0])
        # On the chain the gradient is zero: it has no direction there, and steps are zero anyway.
        return max(square, np.finfo(float).tiny), slope


# ---- The search for piecewise-smooth periodic motions: closed chains of smooth legs

_SHOOTING = Shooting()
_SHORTEST = 0.02  # a leg shorter than this share of its guess has vanished


class ReturnToStart(eqx.Module):
    """The default closing: the difference of the end of the chain from its start."""

    scene: Scene

    def __call__(self, end: Array, start: Array) -> Array:
        """(m,) zero where the chain closes."""
        return self.scene.system.difference(end, start)


def find_hybrid(
    legs: Sequence[Leg] | Phases,
    y0,
    spans=None,
    *,
    events: int = 1,
    closes: Callable[[Array, Array], Array] | None = None,
    strategy: Shooting | Deflated = _SHOOTING,
    goal: float = GOAL,
    rtol: float = RTOL,
    max_iterations: int = 60,
    seconds: float = SECONDS,
    report: Callable[[newton.Iteration], None] = lambda iteration: None,
    throw: bool = True,
    unlike: Sequence[HybridOrbit] = (),
) -> HybridOrbit:
    """The periodic chain of legs near a guess.

    Args:
      legs: the legs in order, of which the last leads to the first; or phases by name, as for
        `simulate_phases` (`scenes.phases_of` has those of ready-made scenes). The legs are then
        those that the motion from `y0` passes, and their bounds are those of the phases.
      y0: (k,) guess of the start of the first leg.
      spans: (n,) guess of the duration of each leg; with phases, by default those of the motion
        from `y0`.
      events: with phases, the number of them in a period, over which the motion from `y0` is
        followed.
      closes: (end, start) -> closing error, a module or a named function; by default the
        difference of the states. One that leaves out a position finds motions that advance.
      strategy: ``orbits.Shooting()``, or ``orbits.Deflated(known)`` for a chain unlike known ones
        from the same guess. Chains are compared by the starts of their legs and their periods, so
        legs should begin with an event.
      goal: largest closing error of a solution, in units of its change when the states change by
        their sizes.
      rtol: tolerance of the integrations.
      max_iterations: largest number of Newton steps.
      seconds: time limit of the search, as for `find`.
      report: called with an `Iteration` after each step; its period is the last leg's span.
      throw: raise if none was found.
      unlike: deprecated; use ``strategy=orbits.Deflated(known)``.
    Returns:
      The chain; where chains form a family, the one nearest to the guess.
    Raises:
      ValueError: `legs` is empty or has other elements, a leg's rate, an event or a change depends
        on time, `y0` or `spans` has the wrong shape, `spans`, `goal` or `rtol` is out of range; or
        the motion from `y0` is not in its first phase again after `events` phases.
      SearchError: none was found (``throw=True``).
    Limits: host only. Only the bounds of a leg detect ends that are passed earlier.
    Example:
      A ball that bounces without loss, from its highest point to its highest point:

      >>> import jax.numpy as jnp, orbits
      >>> from jaxdyn.integrate import events
      >>> from jaxdyn import scenes
      >>> def bounce(t, y):
      ...     return y * jnp.array([1.0, 1.0, 1.0, -1.0])
      >>> ball = scenes.cannonball(g=10.0)
      >>> falls = orbits.Leg(ball, (events.Reaches(1, 0.0),), bounce)
      >>> rises = orbits.Leg(ball, (events.Reaches(3, 0.0), events.Reaches(1, 5.0)))
      >>> found = orbits.find_hybrid([falls, rises], [0.0, 4.0, 0.0, 0.0], [0.8, 0.9])
      >>> round(found.period, 12)
      2.0

      A gait of two legs that walk down a slope:

      >>> walker = scenes.simplest_walker(slope=0.009)
      >>> gait = orbits.find_hybrid(scenes.phases_of(walker), walker.y0)
      >>> round(float(gait.y0[0]), 9)
      0.200310901
    """
    check_on_host("find_hybrid", (legs, y0, spans), "Find it outside of the transformation.")
    path: Path = ()
    if isinstance(legs, Mapping):
        path, durations = follow(legs, y0, events)
        spans = durations if spans is None else spans
    legs = legs_of(legs, path)
    start, times = _start_and_times(legs, y0, spans)
    effort = Effort(
        goal=goal, rtol=rtol, max_iterations=max_iterations, report=report, seconds=seconds
    )
    effort.check()
    closes = ReturnToStart(legs[0].scene) if closes is None else closes
    found = _solve(
        ChainEquations(legs, closes, path=path),
        start,
        times,
        effort,
        _deflated_chains(strategy, unlike),
    )
    if effort.over and not found.ok:
        found = dataclasses.replace(found, outcome=Outcome.TIME_LIMIT)
    if throw and not found.ok:
        raise SearchError(f"{found.message} {effort}")
    return found


def _deflated_chains(strategy: Shooting | Deflated, unlike: Sequence[HybridOrbit]) -> Sequence[Any]:
    """The known chains that the strategy deflates."""
    if unlike:
        message = (
            "unlike of orbits.find_hybrid is now strategy=orbits.Deflated(known); the old argument "
            "will be removed in the next version."
        )
        warnings.warn(message, DeprecationWarning, stacklevel=3)
        strategy = Deflated(unlike)
    if isinstance(strategy, Deflated):
        return strategy.known
    if not isinstance(strategy, Shooting):
        raise fail("strategy", "orbits.Shooting() or orbits.Deflated(known)", repr(strategy))
    return ()


def _solve(
    chain: ChainEquations,
    start: np.ndarray,
    times: np.ndarray,
    effort: Effort,
    known: Sequence[Any],
) -> HybridOrbit:
    """The chain near a start (k,) and spans (n,) by Newton's method, or the best iterate."""
    x = chain.pack(start, times)
    first = chain.linearize(x, effort.rtol)
    leg_sizes = chain.sizes(first, times)
    units = chain.pack(leg_sizes[0], times)
    rows = chain.residual_units(first, times, leg_sizes)

    def evaluated(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = chain.linearize(x, effort.rtol)
        return found.value / rows, found.jacobian * units / rows[:, None]

    shortest = chain.pack(np.full(len(start), -np.inf), _SHORTEST * times)
    bounds = shortest, np.full(len(x), np.inf)
    squares = None
    if known:
        effort.begin("Newton's method with the known chains deflated")
        squares = Squares(chain, known, leg_sizes[0])
        x = (
            DeflatedNewton(evaluated, units, squares, units, bounds, lambda x: False, effort)
            .solve(x)
            .x
        )
    effort.begin(f"Newton's method on {number_of(len(chain.legs), 'leg')}")
    result = newton.solve(
        evaluated,
        x,
        lower=bounds[0],
        upper=bounds[1],
        goal=effort.goal,
        max_iterations=effort.max_iterations,
        over=lambda: effort.over,
        report=effort.report,
        units=units,
    )
    found = chain.orbit(
        result.x,
        residual=float(np.abs(result.residual).max()),
        outcome=_outcome(result),
        iterations=result.iterations,
        rtol=effort.rtol,
    )
    if squares is not None and (not found.ok or squares.distance(result.x) <= SAME):
        found = dataclasses.replace(found, outcome=Outcome.NO_OTHER)
    return found


class _Part(eqx.Module):
    """An event or a change of a leg as a rate, so that its program can be read."""

    numbers: Any
    rest: Any = eqx.field(static=True)

    @classmethod
    def of(cls, part: Any) -> "_Part":
        return cls(*eqx.partition(part, eqx.is_array))

    def rate(self, t: Array, y: Array) -> Array:
        part = eqx.combine(self.numbers, self.rest)
        return jnp.asarray(part.value(t, y) if isinstance(part, Event) else part(t, y), float)


def _check_timeless(name: str, part: Any, k: int) -> None:
    """Raise ValueError if an event or a change depends on time, which a chain does not have."""
    if plan_of(_Part.of(part), k).depends_on_time:
        wanted = "a function of the state alone"
        remedy = (
            "Legs start at a time 0 of their own, in no step with a drive. Make the phase of the "
            "drive an entry of the state, whose rate is its frequency, and let `closes` measure it "
            "up to whole turns."
        )
        raise fail(name, wanted, "one that depends on time", remedy)


def check_legs(legs: tuple[Leg, ...]) -> None:
    """Raise ValueError for legs that do not form a chain, or that depend on time."""
    if not legs:
        raise fail("legs", "at least one", "none", "A chain has legs.")
    for i, leg in enumerate(legs):
        if not isinstance(leg, Leg):
            raise fail(f"legs[{i}]", "a Leg", type(leg).__name__, "Write Leg(scene, ends).")
        leg.check_functions()
        for name, events in (("ends", leg.ends), ("bounds", leg.bounds)):
            if not (isinstance(events, tuple) and all(isinstance(x, Event) for x in events)):
                got = type(events).__name__
                raise fail(f"legs[{i}].{name}", "a tuple of events", got, "Write (event,) for one.")
        if is_driven(check_scene(leg.scene)):
            remedy = "Each leg starts at its own time 0."
            raise fail(f"legs[{i}]", "a scene that does not depend on time", "a driven one", remedy)
        parts = {f"ends[{j}]": event for j, event in enumerate(leg.ends)}
        parts |= {f"bounds[{j}]": event for j, event in enumerate(leg.bounds)}
        for name, part in (parts | {"change": leg.change}).items():
            _check_timeless(f"legs[{i}].{name}", part, len(leg.scene.y0))


def _start_and_times(legs: tuple[Leg, ...], y0, spans) -> tuple[np.ndarray, np.ndarray]:
    check_legs(legs)
    start = np.asarray(y0, float)
    k = len(legs[0].scene.y0)
    if start.shape != (k,) or not np.isfinite(start).all():
        raise fail("y0", f"a state, {k} finite numbers", f"{y0}")
    times = np.asarray(spans, float)
    if times.shape != (len(legs),) or not (np.isfinite(times) & (times > 0)).all():
        raise fail("spans", f"a time > 0 for each of {len(legs)} legs", f"{spans}")
    return start, times


def _outcome(result: newton.Result) -> Outcome:
    if not np.isfinite(result.residual).all():
        return Outcome.COLLISION
    if result.at_bound:
        return Outcome.TRIVIAL
    if result.converged:
        return Outcome.FOUND
    return Outcome.ITERATION_LIMIT if result.limit else Outcome.OPEN_CHAIN
