"""Newton's method on the closing equations, in as many segments as rounding requires."""

import dataclasses

import equinox as eqx
import numpy as np

from jaxdyn._text import number_of
from orbits.motion import attracts
from orbits.orbit import Orbit, Outcome
from orbits.shooting import newton
from orbits.shooting.collocation import Collocation
from orbits.shooting.equations import Equations, InUnits
from orbits.shooting.outcomes import Trouble, orbit_at, outcome_of
from orbits.shooting.segmentation import (
    SEGMENTS_MOST,
    cut_into_segments,
    segments_needed,
    with_segments,
)
from orbits.shooting.strategy import Effort, Search, Strategy

# ---- More segments for an orbit whose residual is rounding that they may reduce

#: With attracting bodies in plain time, a residual above this share of the goal is rounding that
#: more segments can reduce.
_CLEAN_SHARE = 0.1
#: Largest relative difference of two spans of logarithmic time that belong to the same motion.
_SPAN_MISMATCH = 0.01
#: Residual below which only rounding makes Newton's method stall.
_ROUNDING_STALLS = 1e-6


def finer(
    equations: Equations, cuts: Equations, guess: np.ndarray, orbit: Orbit, effort: Effort
) -> Equations:
    """The equations in more segments, since close encounters inside one amplify rounding.

    The cuts are chosen along the orbit if it closes, even far from the guess. An iterate that does
    not close may be a useless motion, so the cuts are then chosen along the guess, unless the
    iterate has become a different motion.
    """
    left = cuts.s_period is not None and _other_motion(orbit.s_period, cuts.s_period)
    known = np.append(orbit.y0, orbit.period)
    here, rtol = known if orbit.ok or left else guess, effort.rtol
    x = equations.spread(here[:-1], here[-1], rtol, orbit.angle)
    needed = segments_needed(equations, x, rtol, effort.limits())
    finer = with_segments(equations, x, rtol, needed)
    if finer.segments <= cuts.segments and not _other_motion(finer.s_period, cuts.s_period):
        finer = with_segments(equations, x, rtol, min(2 * cuts.segments, SEGMENTS_MOST))
    return finer


def gains_from_cutting(orbit: Orbit, cuts: Equations, goal: float) -> bool:
    """Whether the residual is rounding that more segments may reduce."""
    if not orbit.ok:
        return orbit.outcome == Outcome.NO_DESCENT and orbit.residual < _ROUNDING_STALLS
    if orbit.residual <= _CLEAN_SHARE * goal:
        return False
    if cuts.s_period is None:
        return attracts(orbit.scene)
    return _other_motion(orbit.s_period, cuts.s_period)


def _other_motion(a: float | None, b: float | None) -> bool:
    """Whether two spans of logarithmic time are those of different motions."""
    return a is not b if a is None or b is None else abs(a / b - 1) > _SPAN_MISMATCH


# ---- Guesses whose start is periodic already, so that only the period has to be found
#
# Newton's method finds one member of a family near the guess, and an error of the guessed period
# alone makes it change the start as well. If the given start closes after a time near the guessed
# period, that orbit is the one requested.

_STEPS_MOST = 10  # convergence is quadratic
#: Largest share of the residual that the linear model may leave after a step with the start held:
#: a larger one means that the start is not periodic.
_SHARE_LEFT_MOST = 0.7
_PERIOD_FACTOR_MOST = 2.0  # between the periods found and guessed


@np.errstate(over="ignore")  # extreme conditions, e.g. an energy of 1e300: x is returned
def retime(
    closed: InUnits, x: np.ndarray, *, lower: np.ndarray, upper: np.ndarray, effort: Effort
) -> np.ndarray:
    """x with the period after which its start closes, or x itself if none is near.

    Everything but the start may change: the period, the states between segments, the angle of a
    relative orbit. A start that is not periodic costs one integration: the linearised equations
    then have no solution in these unknowns.

    Args:
      closed: the closing equations.
      x: (n,) the guess.
      lower: (n,) lower bounds of x.
      upper: (n,) upper bounds of x.
      effort: the goal, and the limit of time.
    """
    equations, units = closed.equations, closed.units.x
    free = np.arange(len(x)) >= len(equations.closing.free(len(equations.scene.y0)))
    free[-1] = not equations.driven
    new = x
    for _ in range(_STEPS_MOST if free.any() else 0):
        residual, jacobian = closed(new)
        if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
            break
        if np.abs(residual).max() <= effort.goal:
            return new
        if effort.over:
            break
        slopes = jacobian[:, free]
        step = np.linalg.lstsq(slopes, -residual, rcond=None)[0]
        if np.linalg.norm(residual + slopes @ step) > _SHARE_LEFT_MOST * np.linalg.norm(residual):
            break
        new = new.copy()
        new[free] += step * units[free]
        near = 1 / _PERIOD_FACTOR_MOST < new[-1] / x[-1] < _PERIOD_FACTOR_MOST
        if not near or not ((lower <= new) & (new <= upper)).all():
            break
    return x


# ---- Newton's method on the closing equations, in as many segments as rounding requires

#: Most times that a motion is cut anew: more than the doublings from one segment to the maximum.
_RECUTS_MOST = 6


@dataclasses.dataclass(frozen=True)
class Shooting(Strategy):
    """Newton's method from the guess, with integrations over one segment or several."""

    def orbit(self, search: Search) -> Orbit:
        """The orbit near the guess, or the best iterate and the reason."""
        problem, equations, effort = search.problem, search.equations, search.effort
        guess, rtol = problem.guess, effort.rtol
        limits = effort.limits()
        cuts = cut_into_segments(
            equations, guess, rtol, search.segments, search.angle, limits=limits
        )
        x = cuts.spread(guess[:-1], guess[-1], rtol, angle=search.angle)
        lower, upper = cuts.bounds(problem.lower, problem.upper)
        closed = InUnits(cuts, x, rtol, limits)
        x = retime(closed, x, lower=lower, upper=upper, effort=effort)
        orbit = _solution(closed, x, search)
        for _ in range(0 if search.segments else _RECUTS_MOST):
            enough = cuts.segments >= SEGMENTS_MOST or effort.over
            if enough or not gains_from_cutting(orbit, cuts, effort.goal):
                break
            cuts = finer(equations, cuts, guess, orbit, effort)
            if effort.over:
                break
            x = cuts.spread(orbit.y0, orbit.period, rtol, angle=orbit.angle)
            again = _solution(InUnits(cuts, x, rtol, limits), x, search)
            if orbit.ok and not (again.ok and again.residual < orbit.residual):
                break
            orbit = eqx.tree_at(lambda o: o.iterations, again, orbit.iterations + again.iterations)
        return orbit


def _solution(closed: InUnits, x: np.ndarray, search: Search) -> Orbit:
    """The orbit, or the best iterate, of Newton's method on the closing equations from x."""
    equations, problem, effort = closed.equations, search.problem, search.effort
    effort.begin(f"Newton's method in {number_of(equations.segments, 'segment')}")
    lower, upper = equations.bounds(problem.lower, problem.upper)
    trouble = Trouble(equations, x)
    result = newton.solve(
        closed,
        x,
        lower=lower,
        upper=upper,
        goal=effort.goal,
        max_iterations=effort.max_iterations,
        keep_going=lambda x: trouble(equations, x) is None,
        over=lambda: effort.over,
        report=effort.report,
        units=closed.units.x,
    )
    return orbit_at(
        equations,
        result.x,
        float(np.max(np.abs(result.residual))),
        outcome_of(closed, result, trouble),
        rtol=effort.rtol,
        iterations=result.iterations,
    )


# ---- The default strategy: one of the others, then collocation where that fails and it may help


@dataclasses.dataclass(frozen=True)
class Automatic(Strategy):
    """A strategy, followed by `Collocation` where it fails and the guess is stiff.

    Attributes:
      first: the strategy that is tried first.
    """

    first: Strategy = dataclasses.field(default_factory=Shooting)

    def orbit(self, search: Search) -> Orbit:
        """The orbit near the guess, or the best iterate and the reason."""
        orbit = self.first.orbit(search)
        if orbit.ok or search.effort.over or not Collocation.may_help(search, orbit):
            return orbit
        again = Collocation().orbit(dataclasses.replace(search, segments=None))
        return again if again.ok else orbit
