"""The search for piecewise-smooth periodic motions: closed chains of smooth legs.

The unknowns are the start of the first leg and the duration of each leg. The equations are the
ends of each leg, its further conditions, and the closing of the chain. Times are unknowns, not
found by a search for events: a landing without relative velocity grazes the ground, where the
time of an event has no derivative, while these equations are regular. The price is that a solution
may pass an end before its time; the bounds of a leg exclude that.

All are numbers of order 1: a state is in units of the sizes of its entries along the chain, a time
in those of its guess, and an equation in units of what changes of the states by their sizes make of
it.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import fail, positive, untraced, whole
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.simulation import solve
from jaxdyn.integrate.spans import tolerances
from jaxdyn.plan import plan_of
from jaxdyn.scene import Scene, checked_scene
from orbits.closing.given import driven
from orbits.closing.sizes import sizes
from orbits.hybrid.legs import HybridOrbit, Leg, Path
from orbits.hybrid.phases import Phases, followed, legs_of
from orbits.orbit import Outcome, SearchError
from orbits.shooting import newton
from orbits.shooting.finding import GOAL, RTOL

_SHORTEST = 0.02  # of its guess: a shorter leg has vanished


class Comes(eqx.Module):
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
    goal: float = GOAL,
    rtol: float = RTOL,
    max_iterations: int = 60,
    report: Callable[[newton.Iteration], None] = lambda iteration: None,
    throw: bool = True,
) -> HybridOrbit:
    """The periodic chain of legs near a guess.

    Args:
      legs: in order; the last one leads to the first. Or phases by name, as for `simulate_phases`
        (`scenes.phases_of` has those of ready-made scenes): the legs are those that the motion from
        `y0` passes, and the bounds of the phases are theirs.
      y0: (k,) guess of the start of the first leg.
      spans: (n,) guess of the duration of each leg; with phases by default those of the motion
        from `y0`.
      events: with phases, how many of them a period has: the motion from `y0` is followed so far.
      closes: (end, start) -> closing error, a module or a named function; by default the
        difference of the states. One that leaves out a position finds motions that advance.
      goal: largest closing error of a solution, in units of what changes of the states by their
        sizes make of it.
      rtol: tolerance of the integrations.
      max_iterations: largest number of Newton steps.
      report: called with an `Iteration` after each step; its period is the last leg's span.
      throw: raise if none was found.
    Returns:
      The chain; of a family of them the one nearest to the guess.
    Raises:
      ValueError: `legs` is empty or has other elements, a leg's rate, an event or a change depends
        on time, `y0` or `spans` has the wrong shape, `spans`, `goal` or `rtol` is out of range; or
        from `y0` the phases are not `events` ones that lead back to the first.
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
    untraced("find_hybrid", (legs, y0, spans), "Find it outside of the transformation.")
    path: Path = ()
    if isinstance(legs, Mapping):
        path, durations = followed(legs, y0, events)
        spans = durations if spans is None else spans
    legs = legs_of(legs, path)
    start, times = _start_and_times(legs, y0, spans)
    positive("goal", goal, "It is the largest closing error of an orbit.")
    tolerances(rtol, None)  # checked here: inside jit it cannot be
    whole("max_iterations", max_iterations, least=0)
    closes = Comes(legs[0].scene) if closes is None else closes
    k = len(start)
    x = np.concatenate([start, times])
    first = _linearised(legs, closes, x, rtol)
    each = _sizes(legs, first, times)
    units = np.concatenate([each[0], times])
    rows = _changes(legs, closes, first, times, each)

    def evaluated(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = _linearised(legs, closes, x, rtol)
        return found.value / rows, found.jacobian * units / rows[:, None]

    shortest = np.concatenate([np.full(k, -np.inf), _SHORTEST * times])
    result = newton.solve(
        evaluated,
        x,
        lower=shortest,
        upper=np.full(k + len(legs), np.inf),
        goal=goal,
        max_iterations=max_iterations,
        report=report,
        units=units,
    )
    starts = _linearised(legs, closes, result.x, rtol).starts[:-1]
    placed = tuple(
        dataclasses.replace(leg, scene=leg.scene.starting(y, t))
        for leg, y, t in zip(legs, starts, result.x[k:], strict=True)
    )
    found = HybridOrbit(
        legs=placed,
        closes=closes,
        residual=float(np.abs(result.residual).max()),
        outcome=_outcome(result),
        iterations=result.iterations,
        rtol=rtol,
        path=path,
    )
    if found.ok and not found.keeps_bounds:
        found = dataclasses.replace(found, outcome=Outcome.BOUND_PASSED)
    if throw and not found.ok:
        raise SearchError(found.message)
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
    """Raise ValueError if an event or a change depends on time, of which a chain knows nothing."""
    if plan_of(_Part.of(part), k).depends_on_time:
        wanted = "a function of the state alone"
        remedy = (
            "Legs start at a time 0 of their own, in no step with a drive. Make the phase of the "
            "drive an entry of the state, whose rate is its frequency, and let `closes` measure it "
            "up to whole turns."
        )
        raise fail(name, wanted, "one that depends on time", remedy)


def _start_and_times(legs: tuple[Leg, ...], y0, spans) -> tuple[np.ndarray, np.ndarray]:
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
        if driven(checked_scene(leg.scene)):
            remedy = "Each leg starts at its own time 0."
            raise fail(f"legs[{i}]", "a scene that does not depend on time", "a driven one", remedy)
        parts = {f"ends[{j}]": event for j, event in enumerate(leg.ends)}
        parts |= {f"bounds[{j}]": event for j, event in enumerate(leg.bounds)}
        for name, part in (parts | {"change": leg.change}).items():
            _check_timeless(f"legs[{i}].{name}", part, len(leg.scene.y0))
    start = np.asarray(y0, float)
    k = len(legs[0].scene.y0)
    if start.shape != (k,) or not np.isfinite(start).all():
        raise fail("y0", f"a state, {k} finite numbers", f"{y0}")
    times = np.asarray(spans, float)
    if times.shape != (len(legs),) or not (np.isfinite(times) & (times > 0)).all():
        raise fail("spans", f"a time > 0 for each of {len(legs)} legs", f"{spans}")
    return start, times


class _Linearised(NamedTuple):
    """The equations at unknowns.

    Attributes:
      value: (m,) left sides.
      jacobian: (m, n) derivatives by the unknowns.
      starts: the start of each leg, and that of the leg after the last.
      ends: the end of each leg.
    """

    value: np.ndarray
    jacobian: np.ndarray
    starts: list[np.ndarray]
    ends: list[np.ndarray]


def _linearised(legs, closes, x: np.ndarray, rtol) -> _Linearised:
    """The equations and their Jacobian.

    Leg by leg on the host, so that each kind of leg is compiled once for chains of any length.
    """
    k = len(x) - len(legs)
    start, slope = map(np.asarray, _put(legs[0].scene, x[:k]))
    first = slope @ np.eye(k, len(x))
    along = first
    starts, ends, values, rows = [start], [], [], []
    rtol = np.asarray(rtol, float)  # a Python number would be compiled in
    for i, leg in enumerate(legs):
        passed = leg_passed(leg, starts[-1], x[k + i], rtol)
        (y, left, end), (by_start, by_span) = jax.tree.map(np.asarray, passed)
        unit = np.eye(len(x))[k + i]
        along, row = (a @ along + np.outer(b, unit) for a, b in zip(by_start, by_span, strict=True))
        starts.append(y)
        ends.append(end)
        values.append(left)
        rows.append(row)
    left, (by_end, by_first) = jax.tree.map(np.asarray, closing_left(closes, starts[-1], start))
    jacobian = np.concatenate([*rows, by_end @ along + by_first @ first])
    return _Linearised(np.concatenate([*values, left]), jacobian, starts, ends)


def _sizes(legs, first: _Linearised, times: np.ndarray) -> list[np.ndarray]:
    """(k,) of the entries of the state of each leg: the largest of all where these are one kind."""
    each = [
        sizes(leg.scene.starting(y, t))
        for leg, y, t in zip(legs, first.starts[:-1], times, strict=True)
    ]
    labels = [leg.scene.labels() for leg in legs]
    return [
        np.max([z for z, other in zip(each, labels, strict=True) if other == own], axis=0)
        for own in labels
    ]


def _changes(legs, closes, first: _Linearised, times: np.ndarray, each) -> np.ndarray:
    """(m,) what changes of the states by their sizes make of each equation."""
    found = [
        np.asarray(_change(leg, end, t, size))
        for leg, end, t, size in zip(legs, first.ends, times, each, strict=True)
    ]
    _, slopes = jax.tree.map(np.asarray, closing_left(closes, first.starts[-1], first.starts[0]))
    found.append(sum(np.abs(slope) @ each[0] for slope in slopes))
    rows = np.concatenate(found)
    return np.where(rows > 0, rows, 1.0)


@eqx.filter_jit
def _change(leg: Leg, end: Array, span, each: Array) -> Array:
    """(e,) `_changes` of the ends of a leg."""

    def left(end):
        return jnp.asarray([event.value(span, end) for event in leg.ends], float)

    return jnp.abs(jax.jacfwd(left)(end)) @ each


@eqx.filter_jit
def _put(scene: Scene, y: Array) -> tuple[Array, Array]:
    """The nearest start that the constraints allow, and its derivative."""

    def put(y):
        y = scene.system.project(jnp.zeros(()), y)
        return y, y

    slope, y = jax.jacfwd(put, has_aux=True)(y)
    return y, slope


@eqx.filter_jit
def leg_passed(leg: Leg, y: Array, span, rtol):
    """(start of the next leg, residual of the ends, end), and derivatives of the first two."""

    def passed(y, span):
        end = solve(leg.scene.starting(y), span, rtol=rtol).y1
        left = jnp.asarray([event.value(span, end) for event in leg.ends], float)
        both = leg.change(span, end), left
        return both, (*both, end)

    slopes, all_ = jax.jacfwd(passed, argnums=(0, 1), has_aux=True)(y, span)
    return all_, tuple(zip(*slopes, strict=True))


@eqx.filter_jit
def closing_left(closes, end: Array, start: Array):
    """The closing error, and its derivatives by both states."""

    def left(end, start):
        value = closes(end, start)
        return value, value

    slopes, value = jax.jacfwd(left, argnums=(0, 1), has_aux=True)(end, start)
    return value, slopes


def _outcome(result: newton.Result) -> Outcome:
    if not np.isfinite(result.residual).all():
        return Outcome.COLLISION
    if result.at_bound:
        return Outcome.TRIVIAL
    if result.converged:
        return Outcome.FOUND
    return Outcome.ITERATION_LIMIT if result.limit else Outcome.OPEN_CHAIN
