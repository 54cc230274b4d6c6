"""How far is the default from the best of our methods, and from heyoka, at equal true error?

Run: ``python -m benchmarks default``. The problems of `benchmarks.problems` and
`benchmarks.classics`, on which the orders that `default_solver` takes rest, and those of
`benchmarks.others`, on which nothing rests; each from several starts in one call, so that the call
itself does not count. Errors are the largest at the ends, relative to the largest number of the
state, against heyoka in 80-bit floats where it is installed; its time is given too.

Last numbers (2 cores, 2026-11, minima), at errors of 1e-6, 1e-9, 1e-12. The default over the best
of ours is at most 1.15 in 89 of 96 cases, and otherwise: spring network 1.28, Henon-Heiles 1.26,
cannonball 1.30, double pendulum 1.17, Hill 1.23, all at 1e-6, and chain of springs 1.45, 1.20. The
default over heyoka is above 1 for rigid body 1.19, 1.08, and food chain 1.02 at 1e-6. Where forces
do not depend on velocity: figure-eight 0.67, 0.64, 0.62; Kepler's orbit 0.71, 0.72, 0.82;
Henon-Heiles 0.65, 0.76, 0.85; Toda 0.78, 0.91, 0.89; Stoermer 0.60, 0.58, 0.50; galaxy 0.71, 0.81,
0.93; chain 0.63, 0.70, 0.74; spring network 0.17, 0.12, 0.11, Pleiades 0.24, 0.17, 0.15 and outer
planets 0.11, 0.08, 0.08 (compact mode). Five links, by the pair, 0.81, 0.98, 0.99. The rigid body
is one with any matrix of inertia, heyoka's formulas are for principal axes. Compile time over the
pair's, each measured once, is above 1.5 for spring network 3.0 (1.8 s), outer planets 2.1 (1.3 s),
double pendulum 2.0 (1.3 s), spherical pendulum 2.0 (0.9 s), Pleiades 1.7 (1.3 s), rigid body 1.7
(1.3 s), Kepler, Henon-Heiles and three restricted bodies 1.6 (0.8 to 0.9 s).
"""

import functools
from collections.abc import Sequence

import numpy as np

from benchmarks import _peers
from benchmarks._timing import Curves, Method, work_precision
from benchmarks.classics import CLASSICS
from benchmarks.others import OTHERS
from benchmarks.problems import CONSERVATIVE, GENERAL, Problem, figure_eight
from benchmarks.systems import ERRORS, compiled
from jaxdyn.solvers import (
    DOPRI8,
    NYSTROM12,
    STOERMER14,
    STOERMER18,
    TAYLOR8,
    TAYLOR12,
    TAYLOR14,
    TAYLOR16,
    TAYLOR20,
    VERNER9,
    default_solver,
    has_series,
)
from jaxdyn.solvers import Method as Solver

PROBLEMS = {"figure-eight": figure_eight} | CONSERVATIVE | GENERAL | CLASSICS | OTHERS
TOLERANCES = tuple(float(f"1e-{e}") for e in range(4, 16))
_TO_BEST, _TO_HEYOKA = 1.15, 1.0
_TO_HEYOKA_BY_PLACES = 0.7  # where no force depends on velocity
_NOT_COMPACT = 28  # numbers of a state
_STARTS = 4  # of problems with one
_ROUNDS, _QUICK_ROUNDS = 6, 3


def run(quick: bool = False) -> list[Curves]:
    """Times of the default and of every method that fits."""
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    # Not the problem's name alone: others measure the same problem, and results go by names.
    return [curves(f"default: {name}", make(), rounds) for name, make in PROBLEMS.items()]


def curves(
    name: str, problem: Problem, rounds: int, tolerances: Sequence[float] = TOLERANCES
) -> Curves:
    """Error against time of the default and of the methods that fit a problem."""
    scene = problem.scene
    problem = problem._replace(y0s=np.repeat(problem.y0s, repeats(problem), axis=0))
    ways = {solver.name: compiled(problem, tolerances, solver) for solver in fitting(problem)}
    taken = list(dict.fromkeys(default_solver(scene, rtol=rtol).name for rtol in tolerances))
    if len(taken) == 1:  # not the same program twice
        ways.pop(taken[0])
    methods = {f"default, {' and '.join(taken)}": compiled(problem, tolerances)} | ways
    bars = {method: (_TO_BEST,) * len(ERRORS) for method in ways}
    if _peers.importable("heyoka"):
        truth = _peers.heyoka_precise(problem)
        # Its other mode takes minutes to build a program of so many formulas.
        compact = len(scene.y0) > _NOT_COMPACT
        peer = "heyoka compact" if compact else "heyoka"
        build = functools.partial(_peers.heyoka, problem, compact=compact)
        methods[peer] = Method(build, tolerances[1::2])
        bar = _TO_HEYOKA_BY_PLACES if scene.second_order else _TO_HEYOKA
        bars[peer] = (bar,) * len(ERRORS)
    else:
        truth = compiled(problem, tolerances).build(1e-15)()
    return work_precision(name, methods, truth, ERRORS, rounds, bars)


def repeats(problem: Problem) -> int:
    """How often a call solves a problem from each of its starts."""
    return _STARTS if len(problem.y0s) == 1 else 1


def fitting(problem: Problem) -> tuple[Solver, ...]:
    """Methods with a tolerance that fit the scene, for motions that are not stiff."""
    scene = problem.scene
    second = (NYSTROM12, STOERMER14, STOERMER18) if scene.second_order else ()
    series = (
        (TAYLOR8, TAYLOR12, TAYLOR14, TAYLOR16, TAYLOR20) if has_series(scene, scene.y0) else ()
    )
    return VERNER9, DOPRI8, *second, *series
