"""Find a periodic orbit near a guess: shooting with Newton's method."""

import dataclasses
import math
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status
from jaxdyn._checks import positive, whole
from jaxdyn.simulate import solve
from jaxdyn.spans import tolerances
from orbits import newton
from orbits.closing import PLAIN, Closing
from orbits.conditions import Condition
from orbits.equations import MAX_STEPS, Equations, size_and_speed
from orbits.given import checked, driven
from orbits.problem import Orbit, Outcome, SearchError

RTOL = 1e-14
GOAL = 1e-12
#: Growth of errors over a segment from which on more segments are taken: rounding of 1e-16,
#: grown so much, is well below the goal.
_GROWTH = 300.0
#: The same where rounding of each moment on the way is followed, not that of the start alone.
_GROWTH_INSIDE = 3000.0
_SEGMENTS_MOST = 32
_SEGMENTS_GIVEN = 256  # all of them are one matrix
_SAMPLES = 4096  # of a motion, to see how fast it changes where
_ROUNDINGS = 64.0  # of the unit, in the course of one segment
_NOISE = 4.0  # times what a rounding of the unknowns changes is what none of them can avoid
_NEARLY = 1e-6  # a residual at which Newton's method stalls only for rounding
_ESCAPE = 100.0  # times the guess's size is a run-away
_TRIVIAL = 0.02  # of the guessed period, or of its path length, is a trivial solution


def find(
    scene: Scene,
    y0=None,
    period=None,
    *,
    lower=None,
    upper=None,
    closing: Closing | Sequence[Closing] = PLAIN,
    hold: Condition | Sequence[Condition] = (),
    segments: int | None = None,
    goal: float = GOAL,
    rtol: float = RTOL,
    max_iterations: int = 60,
    report: Callable[[newton.Iteration], None] = lambda iteration: None,
    throw: bool = True,
) -> Orbit:
    """The periodic orbit near a guess.

    Args:
      scene: what moves. Where its rate depends on time the period stays as it is guessed.
      y0: (k,) guess of the start; the scene's own if left out.
      period: () guess of the full period; the scene's own span if left out.
      lower: (k + 1,) lower bounds of the start and the period; -inf where there is none. An
        entry whose bounds are equal stays fixed: a phase condition.
      upper: (k + 1,) upper bounds.
      closing: what must hold after which part of the period; of several, the one that the
        guess misses least.
      hold: conditions on the orbit besides closing, e.g. ``orbits.Energy(-1.0)``.
      segments: pieces integrated by themselves (multiple shooting); as many as the growth of
        errors along the guess calls for if left out.
      goal: largest closing error that counts as an orbit, or the rounding level of the most
        finely cut motion, if that is larger; `Orbit.residual` says which it was.
      rtol: tolerance of the integrations.
      max_iterations: Newton steps at most.
      report: called with an `Iteration` after each step.
      throw: raise if no orbit was found; with False look at `Orbit.outcome`.
    Returns:
      The orbit, or with ``throw=False`` the best iterate and the reason.
    Raises:
      ValueError: numbers that make no sense.
      SearchError: no orbit was found (``throw=True``).
    Limits: host only, not inside jit; `solution` makes what was found differentiable.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
      >>> round(eight.period, 6)
      6.325914
    """
    closings, conditions = _several(closing), _several(hold)
    guess, lower, upper = checked(scene, y0, period, lower, upper, closings, conditions)
    positive("goal", goal, "It is the largest closing error of an orbit.")
    tolerances(rtol, None)  # refuses what is none; inside jit it could not
    whole("max_iterations", max_iterations, least=0)
    scene = scene.starting(guess[:-1], guess[-1])
    closing, angle = _nearest(scene, closings, rtol)
    equations = Equations(scene, closing, conditions, driven=driven(scene))
    cuts = cut(equations, guess, rtol, segments, angle)
    x = cuts.spread(guess[:-1], guess[-1], rtol, angle)
    orbit = _solved(cuts, x, lower, upper, goal, rtol, max_iterations, report)
    while segments is None and _at_rounding(orbit) and cuts.segments < _SEGMENTS_MOST:
        # Near encounters inside a segment magnify rounding: shorter ones, from where it stalled.
        needed = _needed(equations, guess, rtol, 0.0)
        more = min(max(2 * cuts.segments, needed), _SEGMENTS_MOST)
        cuts = _with_segments(equations, guess, rtol, more)
        x = cuts.spread(orbit.y0, orbit.period, rtol, orbit.angle)
        orbit = _solved(cuts, x, lower, upper, goal, rtol, max_iterations, report)
    if throw and not orbit.ok:
        raise SearchError(orbit.message)
    return orbit


def _several(given) -> tuple:
    """One or more, as a tuple; what they are is checked later."""
    return tuple(given) if isinstance(given, list | tuple) else (given,)


def _at_rounding(orbit: Orbit) -> bool:
    return orbit.outcome == Outcome.NO_DESCENT and orbit.residual < _NEARLY


def _solved(
    equations: Equations,
    x: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    goal: float,
    rtol: float,
    max_iterations: int,
    report: Callable[[newton.Iteration], None],
) -> Orbit:
    """Newton's method on closing equations from a point x on."""
    low, high = equations.bounds(lower, upper)
    trouble = _Trouble(equations, x)

    def evaluated(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = equations(x, rtol)
        return np.asarray(found.residual), np.asarray(found.jacobian)

    result = newton.solve(
        evaluated,
        x,
        lower=low,
        upper=high,
        goal=goal,
        max_iterations=max_iterations,
        keep_going=lambda x: trouble(x) is None,
        report=report,
    )
    outcome = _outcome(equations, result, trouble, rtol)
    residual = float(np.max(np.abs(result.residual)))
    return orbit_at(equations, result.x, residual, outcome, result.iterations, rtol)


def orbit_at(equations: Equations, x, residual: float, outcome: Outcome, iterations: int, rtol):
    """The orbit that x stands for."""
    unknowns = equations.unpack(x)
    scene = equations.scene_at(unknowns.parameter)
    scene = scene.starting(equations.start(jnp.asarray(x)), unknowns.period)
    angle = float(unknowns.angle)
    return Orbit(scene, equations.closing, residual, outcome, iterations, rtol, angle)


def cut(equations: Equations, guess, rtol, segments: int | None, angle=0.0, parameter=0.0):
    """The equations with so many segments, or as many as the guess's growth calls for."""
    if segments is None:
        x = equations.spread(guess[:-1], guess[-1], rtol, angle, parameter)
        growth = float(np.linalg.norm(np.asarray(equations(x, rtol).transitions)[0]))
        large = _GROWTH < growth < math.inf
        segments = _needed(equations, guess, rtol, parameter) if large else 1
    segments = whole("segments", segments, most=_SEGMENTS_GIVEN)
    return _with_segments(equations, guess, rtol, segments, parameter)


def _needed(equations: Equations, guess, rtol, parameter) -> int:
    """So many segments that rounding made anywhere in one grows little to its end."""
    fine = _with_segments(equations, guess, rtol, _SEGMENTS_MOST, parameter)
    maps = fine.transitions(guess[:-1], guess[-1], rtol, parameter)
    # Powers of two: few numbers of segments, few compilations.
    for segments in (1, 2, 4, 8, 16):
        grown = [_largest(part) for part in np.split(maps, segments)]
        if np.max(grown) <= _GROWTH_INSIDE:
            return segments
    return _SEGMENTS_MOST


def _largest(maps: np.ndarray) -> float:
    """The largest derivative of the end of consecutive pieces by a state on the way."""
    total, largest = np.eye(maps.shape[-1]), 0.0
    for one in maps[::-1]:
        total = total @ one
        largest = max(largest, float(np.linalg.norm(total)))
    return largest


def _with_segments(equations: Equations, guess, rtol, segments: int, parameter=0.0) -> Equations:
    """Segments over which the motion's fastest changes grow alike: short near an encounter."""
    if segments == 1:
        return equations
    part = guess[-1] / equations.closing.parts
    ts = np.linspace(0.0, part, _SAMPLES)
    scene = equations.scene_at(jnp.asarray(parameter, float)).starting(guess[:-1])
    fastest = np.asarray(_fastest(scene, ts, solve(scene, part, ts=ts, rtol=rtol).ys)) + 1 / part
    if not np.isfinite(fastest).all():
        return dataclasses.replace(equations, shares=(1 / segments,) * segments)
    grown = np.append(0.0, np.cumsum(0.5 * (fastest[1:] + fastest[:-1])))
    ends = np.interp(np.linspace(0.0, grown[-1], segments + 1), grown, ts)
    return dataclasses.replace(equations, shares=tuple((np.diff(ends) / part).tolist()))


@jax.jit
def _fastest(scene: Scene, ts: Array, ys: Array) -> Array:
    """(s,) rates of change along a motion: about the largest eigenvalue of the rate's slope.

    A root of a power's norm, since eigenvalues of thousands of matrices take longer than orbits.
    """
    slopes = jax.vmap(jax.jacfwd(scene.rate, argnums=1))(ts, ys)
    fourth = jnp.linalg.matrix_power(slopes, 4)
    return jnp.sqrt(jnp.sqrt(jnp.linalg.norm(fourth, axis=(1, 2))))


def _nearest(scene: Scene, closings: tuple[Closing, ...], rtol) -> tuple[Closing, float]:
    """The closing that the guess misses least, and its best angle."""
    if len(closings) == 1 and not closings[0].turns:
        return closings[0], 0.0
    best = (math.inf, closings[0], 0.0)
    for closing in closings:
        system, y0 = scene.system, jnp.asarray(scene.y0)
        end = solve(scene, float(scene.t1) / closing.parts, rtol=rtol).y1
        angle = closing.angle(system, end, y0)
        error = float(jnp.linalg.norm(closing.miss(system, end, y0, jnp.asarray(angle))))
        if error < best[0]:
            best = (error, closing, angle)
    return best[1:]


class _Trouble:
    """Whether an iterate is on its way to a solution that is none."""

    def __init__(self, equations: Equations, guess: np.ndarray):
        self.equations = equations
        self.period = guess[-1]
        self.size, self.path = self._size_and_path(guess)

    def __call__(self, x: np.ndarray) -> Outcome | None:
        size, path = self._size_and_path(x)
        # A guess of zeros has no size to compare with.
        if size > _ESCAPE * self.size > 0:
            return Outcome.ESCAPE
        if self.equations.driven:  # the period is the drive's, and rest is an orbit like others
            return None
        if x[-1] < _TRIVIAL * self.period or path <= _TRIVIAL * self.path:
            return Outcome.TRIVIAL
        return None

    def _size_and_path(self, x: np.ndarray) -> tuple[float, float]:
        size, speed = size_and_speed(self.equations, x)
        return float(size), float(speed) * x[-1]


def _outcome(
    equations: Equations, result: newton.Result, trouble: _Trouble, rtol: float
) -> Outcome:
    if not np.isfinite(result.residual).all():
        # Without tangents, which blow up sooner and hide why the motion itself ends.
        x = equations.unpack(result.x)
        scene = equations.scene_at(x.parameter).starting(equations.start(result.x))
        part = x.period / equations.closing.parts
        status = solve(scene, part, rtol=rtol, max_steps=MAX_STEPS).status
        return Outcome.STEP_LIMIT if int(status) == Status.STEP_LIMIT else Outcome.COLLISION
    outcome = trouble(result.x)
    if outcome is not None:
        return outcome
    if result.converged:
        return Outcome.FOUND
    if result.at_bound:
        return Outcome.BOUND
    if result.limit:
        return Outcome.ITERATION_LIMIT
    return Outcome.FOUND if _at_floor(equations, result, rtol) else Outcome.NO_DESCENT


def _at_floor(equations: Equations, result: newton.Result, rtol: float) -> bool:
    """Whether what is left is rounding, grown over the segments: no goal below it can be met."""
    if equations.segments < _SEGMENTS_MOST:
        return False
    left, unit = np.abs(result.residual).max(), np.finfo(float).eps
    growth = np.linalg.norm(equations(result.x, rtol).transitions, axis=(1, 2)).max()
    if left <= _ROUNDINGS * unit * growth:
        return True
    # An encounter inside a segment magnifies more: what does a rounding of all numbers change?
    signs = np.where(np.arange(len(result.x)) % 2, 1.0, -1.0)
    moved = equations(result.x * (1 + unit * signs), rtol).residual
    return bool(left <= _NOISE * np.abs(moved - result.residual).max())
