"""The search for a periodic orbit near a guess, by a strategy."""

import dataclasses
import math
import warnings
from collections.abc import Callable, Sequence

import equinox as eqx
import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import check_first, fail
from orbits.closing.closings import PLAIN, Closing, Hold, symmetric_closing
from orbits.closing.given import Problem, beside, pose
from orbits.closing.sizes import sizes
from orbits.motion import quick_solve
from orbits.orbit import Orbit, Outcome, SearchError
from orbits.shooting.collocation import Collocation
from orbits.shooting.deflation import Deflated
from orbits.shooting.descent import Descent
from orbits.shooting.equations import Equations
from orbits.shooting.multiple import Automatic, Shooting
from orbits.shooting.newton import Iteration
from orbits.shooting.strategy import (
    GOAL,
    ITERATIONS,
    RTOL,
    SECONDS,
    Effort,
    Search,
    Strategy,
    check_strategy,
)

#: The default of `find`.
AUTOMATIC = Automatic()


@check_first
def find(
    scene: Scene,
    y0=None,
    period=None,
    *,
    lower=None,
    upper=None,
    closing: Closing | Sequence[Closing] = PLAIN,
    hold: Hold = (),
    strategy: Strategy = AUTOMATIC,
    segments: int | None = None,
    goal: float = GOAL,
    rtol: float = RTOL,
    max_iterations: int = ITERATIONS,
    seconds: float = SECONDS,
    report: Callable[[Iteration], None] = lambda iteration: None,
    throw: bool = True,
    rough: bool = False,
    collocation: bool | None = None,
    unlike: Sequence[Orbit] = (),
) -> Orbit:
    """The periodic orbit near a guess.

    Where orbits form a family, it is the member through the given start, if that closes after a
    time near the guessed period, and otherwise a member near it. `Orbit.shift` says how far the
    start has moved.

    Args:
      scene: the scene. If its rate depends on time, `period` is a multiple of the drive's.
      y0: (k,) guess of the start; the scene's own by default.
      period: () guess of the full period; the scene's own span by default.
      lower: (k + 1,) lower bounds of the start and the period; -inf for none. An entry whose
        bounds are equal stays fixed: a phase condition.
      upper: (k + 1,) upper bounds.
      closing: the condition that must hold after its part of the period; of several, the one with
        the smallest residual at the guess is taken.
      hold: conditions on the orbit besides closing, e.g. ``orbits.Energy(-1.0)``, or names of
        entries of the state that keep their guessed values, e.g. ``"theta"``.
      strategy: how to look for it. `Shooting()` is Newton's method from the guess; `Descent()`
        descends on the closing error first, from a rough guess; `Deflated(known)` seeks an orbit
        unlike known ones; `Collocation()` is for orbits that are stiff or very unstable. The
        default is shooting, then collocation where that fails and the guess is stiff.
      segments: number of segments integrated independently (multiple shooting); by default as
        many as the growth of errors along the guess requires.
      goal: largest `Orbit.residual` that counts as closed, or the rounding level with the largest
        number of segments if that is larger. It applies to each segment: one run over the whole
        period closes less well if errors grow over it; see `orbits.recheck`.
      rtol: tolerance of the integrations.
      max_iterations: largest number of Newton steps.
      seconds: time limit of the whole search. An integration that has begun is completed. The time
        of compiling does not count; the message of a failed search states it.
      report: called with an `Iteration` after each step, those of the descent included.
      throw: raise if no orbit was found; with False check `Orbit.outcome`.
      rough: deprecated; use ``strategy=orbits.Descent()``.
      collocation: deprecated; use ``strategy=orbits.Collocation()``, for False
        ``strategy=orbits.Shooting()``.
      unlike: deprecated; use ``strategy=orbits.Deflated(known)``.
    Returns:
      The orbit, or with ``throw=False`` the best iterate and the reason.
    Raises:
      ValueError: an argument has the wrong shape, is out of its range or is traced, or does not
        suit the strategy.
      SearchError: no orbit was found (``throw=True``).
    Limits: host only, not inside jit, grad or vmap; `orbits.differentiable` has the derivatives of
      the orbit found.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
      >>> round(eight.period, 6)
      6.325914
    """
    if rough or collocation is not None or unlike:
        strategy = _strategy_of_flags(strategy, rough, collocation, unlike)
    check_strategy(strategy)
    problem = pose(
        scene, y0=y0, period=period, lower=lower, upper=upper, closing=closing, hold=hold
    )
    effort = Effort(
        goal=goal, rtol=rtol, max_iterations=max_iterations, report=report, seconds=seconds
    )
    effort.check()
    nearest, angle = _nearest(problem, rtol)
    equations = Equations(
        scene=problem.scene,
        closing=nearest,
        conditions=problem.conditions,
        beside=beside(problem.scene),
    )
    search = Search(problem, equations, angle, segments, effort)
    orbit = strategy.orbit(search)
    if effort.over and not orbit.ok:
        orbit = dataclasses.replace(orbit, outcome=Outcome.TIME_LIMIT)
    if not orbit.ok:
        hints = _symmetry_hint(problem), _period_hint(problem, period)
        hint = " ".join(filter(None, hints))
        if throw:
            raise SearchError(f"{orbit.message} {effort} {hint}".rstrip())
        orbit = dataclasses.replace(orbit, hint=hint)
    shift = np.abs(scene.system.difference(*map(np.asarray, (orbit.y0, problem.scene.y0)))).max()
    return eqx.tree_at(lambda o: o.shift, orbit, float(shift))


def _period_hint(problem: Problem, period) -> str:
    """Which function needs no guess of the period, if none was given; "" otherwise."""
    if period is not None or problem.driven:
        return ""
    return (
        f"No period was given, and the scene's own span, {float(problem.scene.t1):.6g}, is a poor "
        "guess: orbits.search_near(scene) takes one from the scene's own motion."
    )


def _symmetry_hint(problem: Problem) -> str:
    """Which closing suits a symmetric guess better than the plain one; "" for other guesses."""
    better = "" if problem.closings != (PLAIN,) else symmetric_closing(problem.scene)
    if not better:
        return ""
    return f"The guess is symmetric: {better} needs half of the period and of the unknowns."


def _strategy_of_flags(
    strategy: Strategy, rough: bool, collocation: bool | None, unlike: Sequence[Orbit]
) -> Strategy:
    """The strategy that arguments of version 0.2 stand for; the next version removes them.

    Raises:
      ValueError: the arguments exclude each other, or a strategy is given as well.
    """
    if strategy is not AUTOMATIC or ((rough or collocation) and unlike) or (rough and collocation):
        given = {"rough": rough, "collocation": collocation is not None, "unlike": unlike}
        names = ", ".join(name for name, there in given.items() if there)
        raise fail("strategy", "one, and no other way to look for an orbit", f"also {names}")
    if unlike:
        found, text = Deflated(unlike), "Deflated(known)"
    elif collocation:
        found, text = Collocation(), "Collocation()"
    else:
        found, text = (Descent(), "Descent()") if rough else (Shooting(), "Shooting()")
        found = Automatic(found) if collocation is None and not rough else found
    warnings.warn(
        f"rough, collocation and unlike of orbits.find are now strategy=orbits.{text}; the old "
        "arguments go with the next version.",
        DeprecationWarning,
        stacklevel=4,
    )
    return found


def _nearest(problem: Problem, rtol) -> tuple[Closing, float]:
    """The closing with the smallest residual at the guess, and its best angle."""
    scene, closings = problem.scene, problem.closings
    if len(closings) == 1 and not closings[0].turns:
        return closings[0], 0.0
    best, entry_sizes = (math.inf, closings[0], 0.0), sizes(scene)
    for closing in closings:
        system, y0 = scene.system, np.asarray(scene.y0)
        end = quick_solve(scene, float(scene.t1) / closing.parts, rtol=rtol).y1
        end = np.asarray(end)
        angle = closing.angle(system, end, y0)
        miss = np.asarray(closing.residual(system, end, y0, np.asarray(angle)))
        error = float(np.linalg.norm(miss / closing.residual_units(entry_sizes)))
        if error < best[0]:
            best = (error, closing, angle)
    return best[1:]
