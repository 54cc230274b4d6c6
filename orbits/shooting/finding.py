"""Find a periodic orbit near a guess: shooting with Newton's method."""

import dataclasses
import math
from collections.abc import Callable, Sequence

import equinox as eqx
import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn._records.kinds import check_first
from jaxdyn._text import counted
from orbits.closing.closings import PLAIN, Closing
from orbits.closing.conditions import Hold
from orbits.closing.given import Problem, posed
from orbits.closing.sizes import sizes
from orbits.motion import solved
from orbits.orbit import Orbit, Outcome, SearchError
from orbits.shooting import newton
from orbits.shooting.collocation.search import meshed, on_mesh
from orbits.shooting.deflation import SAME, Known, deflated, distance, known
from orbits.shooting.descent import descended
from orbits.shooting.effort import GOAL, RTOL, SECONDS, Effort
from orbits.shooting.equations import Equations
from orbits.shooting.outcomes import Trouble, orbit_at, outcome_of
from orbits.shooting.recutting import finer, gains_from_cutting
from orbits.shooting.retimed import retimed
from orbits.shooting.segmentation import SEGMENTS_MOST, cut
from orbits.shooting.units import InUnits

#: Largest number of new cuts: more than the doublings from one segment to the maximum.
_RECUTS_MOST = 6


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
    segments: int | None = None,
    goal: float = GOAL,
    rtol: float = RTOL,
    rough: bool = False,
    collocation: bool | None = None,
    unlike: Sequence[Orbit] = (),
    max_iterations: int = 60,
    seconds: float = SECONDS,
    report: Callable[[newton.Iteration], None] = lambda iteration: None,
    throw: bool = True,
) -> Orbit:
    """The periodic orbit near a guess.

    Of a family of orbits it is the member through the given start, if that closes after a time
    near the guessed period; else one near it. `Orbit.shift` says how far the start has moved.

    Args:
      scene: the scene. If its rate depends on time, `period` is a multiple of the drive's.
      y0: (k,) guess of the start; the scene's own by default.
      period: () guess of the full period; the scene's own span by default.
      lower: (k + 1,) lower bounds of the start and the period; -inf for none. An entry whose
        bounds are equal stays fixed: a phase condition.
      upper: (k + 1,) upper bounds.
      closing: the condition to hold after its part of the period; of several, the one with the
        smallest residual at the guess.
      hold: conditions on the orbit besides closing, e.g. ``orbits.Energy(-1.0)``, or names of
        entries of the state that keep their guessed values, e.g. ``"theta"``.
      segments: number of segments integrated independently (multiple shooting); by default as
        many as the growth of errors along the guess requires.
      goal: largest closing error that counts as an orbit, or the rounding level with the most
        segments, if that is larger; `Orbit.residual` says which it was.
      rtol: tolerance of the integrations.
      rough: descend on the closing error (optax, Adam) from the guess before Newton's method,
        and where that fails begin with Newton's method after all.
      collocation: solve by Gauss collocation on an adaptive mesh instead of integrations, for
        orbits that are stiff or very unstable; None: where shooting fails and the guess is stiff,
        or integrations reach their step limit. Unless something fixes the start, the orbit then
        starts where it is slow.
      unlike: known orbits of the scene: another one is sought from the same guess, by Newton's
        method with these deflated. The orbits of a family are unlike each other: hold the energy
        of a conservative scene.
      max_iterations: Newton steps at most.
      seconds: time after which the search ends, with all that it tries: an evaluation that has
        begun is completed.
      report: called with an `Iteration` after each step, those of the descent too.
      throw: raise if no orbit was found; with False look at `Orbit.outcome`.
    Returns:
      The orbit, or with ``throw=False`` the best iterate and the reason.
    Raises:
      ValueError: an argument has the wrong shape, is out of its range or is traced; `unlike` has
        no orbits of this scene, or is given beside `rough` or `collocation`.
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
    problem = posed(
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
        driven=problem.driven,
    )
    if unlike:
        if rough or collocation:
            raise fail("unlike", "neither rough nor collocation beside it", "one of them")
        orbit = _closed_elsewhere(problem, equations, angle, segments, effort, known(unlike, scene))
    elif collocation:
        orbit = on_mesh(problem, equations, effort, segments, rough)
    elif rough:
        orbit = _closed_from_afar(problem, equations, angle, segments, effort)
        if not (orbit.ok or effort.over):  # the descent may leave an orbit that is near the guess
            plain = _closed(problem, equations, angle, segments, effort)
            orbit = plain if plain.ok else orbit
    else:
        orbit = _closed(problem, equations, angle, segments, effort)
    if collocation is None and not (orbit.ok or unlike or effort.over):
        orbit = meshed(problem, equations, effort, instead=orbit)
    if effort.over and not orbit.ok:
        orbit = dataclasses.replace(orbit, outcome=Outcome.TIME_LIMIT)
    if throw and not orbit.ok:
        raise SearchError(f"{orbit.message} Tried: {'; '.join(effort.tried)}.")
    shift = np.abs(scene.system.difference(*map(np.asarray, (orbit.y0, problem.scene.y0)))).max()
    return eqx.tree_at(lambda o: o.shift, orbit, float(shift))


def _closed(
    problem: Problem, equations: Equations, angle: float, segments: int | None, effort: Effort
) -> Orbit:
    """The orbit near the guess, in as many segments as rounding requires."""
    guess, rtol = problem.guess, effort.rtol
    cuts = cut(equations, guess, rtol, segments, angle)
    x = cuts.spread(guess[:-1], guess[-1], rtol, angle=angle)
    lower, upper = cuts.bounds(problem.lower, problem.upper)
    closed = InUnits(cuts, x, rtol)
    x = retimed(closed, x, lower=lower, upper=upper, goal=effort.goal)
    orbit = _solved(closed, x, problem, effort)
    for _ in range(0 if segments else _RECUTS_MOST):
        enough = cuts.segments >= SEGMENTS_MOST or effort.over
        if enough or not gains_from_cutting(orbit, cuts, effort.goal):
            break
        cuts = finer(equations, cuts, guess, orbit, rtol)
        x = cuts.spread(orbit.y0, orbit.period, rtol, angle=orbit.angle)
        again = _solved(InUnits(cuts, x, rtol), x, problem, effort)
        if orbit.ok and not (again.ok and again.residual < orbit.residual):
            break
        orbit = eqx.tree_at(lambda o: o.iterations, again, orbit.iterations + again.iterations)
    return orbit


def _closed_from_afar(
    problem: Problem, equations: Equations, angle: float, segments: int | None, effort: Effort
) -> Orbit:
    """The orbit near the end of a descent from the guess."""
    guess = problem.guess
    lower, upper = equations.bounds(problem.lower, problem.upper)
    if problem.driven:  # Adam would move the period however little the error depends on it
        lower[-1] = upper[-1] = guess[-1]
    effort.trying("a descent on the closing error")
    descent = descended(
        equations,
        equations.spread(guess[:-1], guess[-1], effort.rtol, angle=angle),
        lower=lower,
        upper=upper,
        effort=effort,
    )
    if not descent.near:
        return orbit_at(
            equations,
            descent.x,
            residual=descent.residual,
            outcome=Outcome.DESCENT_ENDED,
            iterations=0,
            rtol=effort.rtol,
        )
    orbit = _closed_from(problem, equations, descent.x, segments, effort)
    if orbit.ok or descent.arrived:
        return orbit
    return dataclasses.replace(orbit, outcome=Outcome.DESCENT_ENDED)


def _closed_elsewhere(
    problem: Problem,
    equations: Equations,
    angle: float,
    segments: int | None,
    effort: Effort,
    several: Sequence[Known],
) -> Orbit:
    """The orbit near the end of an iteration in which known orbits are deflated."""
    guess = problem.guess
    cuts = cut(equations, guess, effort.rtol, segments, angle)
    effort.trying("Newton's method with the known orbits deflated")
    found = deflated(
        problem,
        cuts,
        cuts.spread(guess[:-1], guess[-1], effort.rtol, angle=angle),
        several,
        effort,
    )
    if found.near:
        orbit = _closed_from(problem, cuts, found.x, segments, effort)
        at = equations.pack(orbit.y0, (), orbit.angle, 0.0, orbit.period)
        if not orbit.ok or distance(equations, at, several) > SAME:
            return orbit
    return orbit_at(
        cuts,
        found.x,
        residual=found.residual,
        outcome=Outcome.NO_OTHER,
        iterations=0,
        rtol=effort.rtol,
    )


def _closed_from(
    problem: Problem, equations: Equations, x: np.ndarray, segments: int | None, effort: Effort
) -> Orbit:
    """The orbit near a point x of the unknowns."""
    unknowns = equations.unpack(x)
    scene = problem.scene.starting(equations.start_at(x), unknowns.period)
    problem = dataclasses.replace(problem, scene=scene)
    whole = Equations(
        scene=scene,
        closing=equations.closing,
        conditions=equations.conditions,
        driven=equations.driven,
    )
    return _closed(problem, whole, float(unknowns.angle), segments, effort)


def _solved(closed: InUnits, x: np.ndarray, problem: Problem, effort: Effort) -> Orbit:
    """Newton's method on the closing equations, from a point x on."""
    equations = closed.equations
    effort.trying(f"Newton's method in {counted(equations.segments, 'segment')}")
    lower, upper = equations.bounds(problem.lower, problem.upper)
    trouble = Trouble(equations, x)
    result = newton.solve(
        closed,
        x,
        lower=lower,
        upper=upper,
        goal=effort.goal,
        max_iterations=effort.max_iterations,
        keep_going=lambda x: trouble(equations, x) is None and not effort.over,
        report=effort.report,
        units=closed.units.x,
    )
    return orbit_at(
        equations,
        result.x,
        residual=float(np.max(np.abs(result.residual))),
        outcome=outcome_of(closed, result, trouble),
        iterations=result.iterations,
        rtol=effort.rtol,
    )


def _nearest(problem: Problem, rtol) -> tuple[Closing, float]:
    """The closing with the smallest residual at the guess, and its best angle."""
    scene, closings = problem.scene, problem.closings
    if len(closings) == 1 and not closings[0].turns:
        return closings[0], 0.0
    best, each = (math.inf, closings[0], 0.0), sizes(scene)
    for closing in closings:
        system, y0 = scene.system, np.asarray(scene.y0)
        end = solved(scene, float(scene.t1) / closing.parts, rtol=rtol).y1
        end = np.asarray(end)
        angle = closing.angle(system, end, y0)
        miss = np.asarray(closing.miss(system, end, y0, np.asarray(angle)))
        error = float(np.linalg.norm(miss / closing.rows(each)))
        if error < best[0]:
            best = (error, closing, angle)
    return best[1:]
