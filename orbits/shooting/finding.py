"""Find a periodic orbit near a guess: shooting with Newton's method."""

import math
from collections.abc import Callable, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, Status
from jaxdyn._checks import positive, whole
from jaxdyn.integrate.simulation import solve
from jaxdyn.integrate.spans import tolerances
from orbits.closing.closings import PLAIN, Closing
from orbits.closing.conditions import Hold
from orbits.closing.given import checked_guess
from orbits.motion import attracts, logarithmic_period
from orbits.orbit import Orbit, Outcome, SearchError
from orbits.shooting import newton
from orbits.shooting.cuts import SEGMENTS_MOST, cut, needed, with_segments
from orbits.shooting.equations import MAX_STEPS, Equations, size_and_speed
from orbits.shooting.retimed import retimed

RTOL = 1e-14
GOAL = 1e-12
_ROUNDINGS = 64.0  # of the unit, in the course of one segment
_NOISE = 4.0  # times what a rounding of the unknowns changes is what none of them can avoid
_CLEAN = 0.1  # of the goal: where bodies that attract are followed in plain time, more is rounding
_RECUTS = 6  # times at most that a motion is cut anew: more than double one to the most
_STALE = 0.01  # of its period in logarithmic time by which an orbit has left what was cut
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
    hold: Hold = (),
    segments: int | None = None,
    goal: float = GOAL,
    rtol: float = RTOL,
    max_iterations: int = 60,
    report: Callable[[newton.Iteration], None] = lambda iteration: None,
    throw: bool = True,
) -> Orbit:
    """The periodic orbit near a guess.

    Of a family of orbits it is the member through the given start, if that closes after a time
    near the guessed period; else one near it. `Orbit.shift` says how far the start has moved.

    Args:
      scene: what moves. Where its rate depends on time the period stays as it is guessed.
      y0: (k,) guess of the start; the scene's own if left out.
      period: () guess of the full period; the scene's own span if left out.
      lower: (k + 1,) lower bounds of the start and the period; -inf where there is none. An
        entry whose bounds are equal stays fixed: a phase condition.
      upper: (k + 1,) upper bounds.
      closing: what must hold after which part of the period; of several, the one that the
        guess misses least.
      hold: conditions on the orbit besides closing, e.g. ``orbits.Energy(-1.0)``, or names of
        entries of the state that stay as they are guessed, e.g. ``"theta"``.
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
      ValueError: invalid arguments, or traced ones.
      SearchError: no orbit was found (``throw=True``).
    Limits: host only, not inside jit, grad or vmap; `solution` makes what was found
      differentiable.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
      >>> round(eight.period, 6)
      6.325914
    """
    closings = tuple(closing) if isinstance(closing, list | tuple) else (closing,)
    given = checked_guess(scene, y0, period, lower, upper, closings, hold)
    guess, lower, upper = given.guess, given.lower, given.upper
    positive("goal", goal, "It is the largest closing error of an orbit.")
    tolerances(rtol, None)  # refuses what is none; inside jit it could not
    whole("max_iterations", max_iterations, least=0)
    scene = scene.starting(guess[:-1], guess[-1])
    closing, angle = _nearest(scene, closings, rtol)
    equations = Equations(scene, closing, given.conditions, driven=given.driven)
    cuts = cut(equations, guess, rtol, segments, angle)
    x = cuts.spread(guess[:-1], guess[-1], rtol, angle)
    x = retimed(cuts, x, *cuts.bounds(lower, upper), goal, rtol)
    orbit = _solved(cuts, x, lower, upper, goal, rtol, max_iterations, report)
    for _ in range(0 if segments else _RECUTS):
        if cuts.segments >= SEGMENTS_MOST or not _rough(orbit, cuts, goal):
            break
        # Near encounters inside a segment magnify rounding: shorter ones, from where it stalled,
        # and cut along the guess for as long as the orbit is near it.
        left = cuts.s_period is not None and _elsewhere(orbit.s_period, cuts.s_period)
        here = np.append(orbit.y0, orbit.period) if left else guess
        finer = with_segments(equations, here, rtol, needed(equations, here, rtol))
        if finer.segments <= cuts.segments and not _elsewhere(finer.s_period, cuts.s_period):
            finer = with_segments(equations, here, rtol, min(2 * cuts.segments, SEGMENTS_MOST))
        cuts = finer
        x = cuts.spread(orbit.y0, orbit.period, rtol, orbit.angle)
        again = _solved(cuts, x, lower, upper, goal, rtol, max_iterations, report)
        if orbit.ok and not (again.ok and again.residual < orbit.residual):
            break
        orbit = eqx.tree_at(lambda o: o.iterations, again, orbit.iterations + again.iterations)
    if throw and not orbit.ok:
        raise SearchError(orbit.message)
    shift = np.abs(scene.system.difference(orbit.y0, scene.y0)).max()
    return eqx.tree_at(lambda o: o.shift, orbit, float(shift))


def _rough(orbit: Orbit, cuts: Equations, goal: float) -> bool:
    """Whether rounding is what is left, and may become less."""
    if not orbit.ok:
        return orbit.outcome == Outcome.NO_DESCENT and orbit.residual < _NEARLY
    if orbit.residual <= _CLEAN * goal:
        return False
    if cuts.s_period is None:
        return attracts(orbit.scene)
    return _elsewhere(orbit.s_period, cuts.s_period)


def _elsewhere(a: float | None, b: float | None) -> bool:
    """Whether two spans of logarithmic time are those of different motions."""
    return a is not b if a is None or b is None else abs(a / b - 1) > _STALE


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
    # Not that of the equations, which is the one of the motion that was cut.
    s_period = None if equations.s_spans is None else logarithmic_period(scene)
    return Orbit(scene, equations.closing, residual, outcome, iterations, rtol, angle, s_period)


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
    if equations.segments < SEGMENTS_MOST:
        return False
    left, unit = np.abs(result.residual).max(), np.finfo(float).eps
    growth = np.linalg.norm(equations(result.x, rtol).transitions, axis=(1, 2)).max()
    if left <= _ROUNDINGS * unit * growth:
        return True
    # An encounter inside a segment magnifies more: what does a rounding of all numbers change?
    signs = np.where(np.arange(len(result.x)) % 2, 1.0, -1.0)
    moved = equations(result.x * (1 + unit * signs), rtol).residual
    return bool(left <= _NOISE * np.abs(moved - result.residual).max())
