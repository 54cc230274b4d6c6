"""Newton's method on the closing equations, in as many segments as rounding requires."""

import dataclasses

import equinox as eqx
import numpy as np

from jaxdyn._text import number_of
from orbits.orbit import Orbit
from orbits.shooting import newton
from orbits.shooting.outcomes import Trouble, orbit_at, outcome_of
from orbits.shooting.recutting import finer, gains_from_cutting
from orbits.shooting.retimed import retime
from orbits.shooting.segmentation import SEGMENTS_MOST, cut_into_segments
from orbits.shooting.strategy import Search, Strategy
from orbits.shooting.units import InUnits

#: Largest number of new cuts: more than the doublings from one segment to the maximum.
_RECUTS_MOST = 6


@dataclasses.dataclass(frozen=True)
class Shooting(Strategy):
    """Newton's method from the guess, by integrations of one segment or several."""

    def orbit(self, search: Search) -> Orbit:
        """The orbit near the guess, or the best iterate and the reason."""
        problem, equations, effort = search.problem, search.equations, search.effort
        guess, rtol = problem.guess, effort.rtol
        cuts = cut_into_segments(equations, guess, rtol, search.segments, search.angle)
        x = cuts.spread(guess[:-1], guess[-1], rtol, angle=search.angle)
        lower, upper = cuts.bounds(problem.lower, problem.upper)
        closed = InUnits(cuts, x, rtol)
        x = retime(closed, x, lower=lower, upper=upper, goal=effort.goal)
        orbit = _solution(closed, x, search)
        for _ in range(0 if search.segments else _RECUTS_MOST):
            enough = cuts.segments >= SEGMENTS_MOST or effort.over
            if enough or not gains_from_cutting(orbit, cuts, effort.goal):
                break
            cuts = finer(equations, cuts, guess, orbit, rtol)
            x = cuts.spread(orbit.y0, orbit.period, rtol, angle=orbit.angle)
            again = _solution(InUnits(cuts, x, rtol), x, search)
            if orbit.ok and not (again.ok and again.residual < orbit.residual):
                break
            orbit = eqx.tree_at(lambda o: o.iterations, again, orbit.iterations + again.iterations)
        return orbit


def _solution(closed: InUnits, x: np.ndarray, search: Search) -> Orbit:
    """Newton's method on the closing equations, from a point x on."""
    equations, problem, effort = closed.equations, search.problem, search.effort
    effort.trying(f"Newton's method in {number_of(equations.segments, 'segment')}")
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
