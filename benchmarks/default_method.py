"""How far is the default from the best of our methods, and from heyoka, at equal true error?

Run: ``python -m benchmarks default``. The problems of `benchmarks.problems` and
`benchmarks.classics`, on which the orders that `default_solver` takes rest, and those of
`benchmarks.others`, on which nothing rests; each from several starts in one call, so that the call
itself does not count. Errors are the largest at the ends, relative to the largest number of the
state, against heyoka in 80-bit floats where it is installed; its time is given too.

Last numbers (2 cores, 2026-11, minima), at errors of 1e-6, 1e-9, 1e-12. The default over the best
of ours is at most 1.15 in 86 of 96 cases, and otherwise: spring network 1.27, cannonball 1.16,
Kuramoto 1.28 at 1e-6, double pendulum 1.33, 1.25, 1.52, rigid body 1.19 at 1e-12, Chen 1.18 at
1e-9, shaken pendulum 1.25, 1.24 at 1e-9 and 1e-12. Measured once more by themselves, with twelve
rounds: double pendulum 1.06, 1.14, 1.18, shaken pendulum 1.00, 1.12, 1.06, Kuramoto 1.21, 1.05,
1.06: one program measured twice differs by up to 1.3 on such a shared machine. The default over
heyoka is above 1 for the food chain, 1.12 at 1e-6, and for three restricted bodies, 1.52 at 1e-6
(once more: 0.76, 0.76, 0.66).
Where forces do not depend on velocity: figure-eight 0.68, 0.68, 0.55; Kepler's orbit 0.67, 0.71,
0.79; Henon-Heiles 0.61, 0.75, 0.81; Toda 0.91, 0.97, 0.84; Stoermer 0.48, 0.44, 0.35; galaxy 0.71,
0.80, 0.89; chain 0.48, 0.61, 0.59; spring network 0.13, 0.08, 0.08, Pleiades 0.19, 0.13, 0.09 and
outer planets 0.07, 0.07, 0.07 (compact mode). Five links, by the pair, 0.66, 0.79, 0.72. The rigid
body is one with any matrix of inertia, heyoka's formulas are for principal axes: 0.85, 0.83.
Compile time over the pair's, each measured once, is above 1.5 for double pendulum 2.0, Stoermer
1.6 and outer planets 1.6.
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
    # The pair, to whose compile time the default's is compared.
    pair = (NYSTROM12 if scene.second_order else VERNER9).name
    others = ways.keys() - {pair}
    return work_precision(name, methods, truth, ERRORS, rounds, bars, side_by_side=others)


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
