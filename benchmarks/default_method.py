"""How far is the default from the best of our methods, and from heyoka, at equal true error?

Run: ``python -m benchmarks default``. It runs the problems of `benchmarks.problems` and
`benchmarks.classics`, from which the orders of `default_solver` were derived, and those of
`benchmarks.others`, which were not used for that; each from several starts in one call, so that the
overhead of the call does not count. Errors are the largest at the ends, relative to the largest
number of the state, against heyoka in 80-bit floats where it is installed; its time is given too.

Last numbers (2 cores, 2026-11, minima), at errors of 1e-6, 1e-9, 1e-12. The default over the best
of ours is at most 1.15 in 90 of 96 cases, and otherwise: magnetic bottle 1.29 at 1e-12, Pleiades
1.25, Foucault 1.18 and Kuramoto 1.26 at 1e-6, bead on a hoop 1.27, 1.18 at 1e-6 and 1e-9. Most of
that is chance: one program measured twice differs by up to 1.4 on such a shared machine, and of
three runs in a day only the bead at 1e-9 and Kuramoto at 1e-6 are above in all. The default over
heyoka is at most 0.98 (spherical pendulum at 1e-6).
Where forces do not depend on velocity: figure-eight 0.58, 0.46, 0.40; Kepler's orbit 0.66, 0.69,
0.75; Henon-Heiles 0.53, 0.68, 0.77; Toda 0.78, 0.74, 0.73; Stoermer 0.51, 0.49, 0.37; galaxy 0.68,
0.75, 0.93; chain 0.44, 0.59, 0.69; spring network 0.12, 0.09, 0.09, outer planets 0.11, 0.08, 0.07
(compact mode); Pleiades 0.15, 0.09, 0.07. Five links, by the pair, 0.74, 0.82, 0.74. The rigid body
is one with any matrix of inertia, heyoka's formulas are for principal axes: 0.81, 0.76.
Compile time over the pair's, each measured once, is above 1.5 for Kepler's orbit 1.7, Duffing 1.7,
Pleiades 1.7 and outer planets 2.1; for heyoka it is 0.03 to 0.1 s where it is not in compact mode,
a second and more for Pleiades.
"""

import functools
from collections.abc import Sequence

import numpy as np

from benchmarks import _peers
from benchmarks._timing import Curves, Method, work_precision
from benchmarks.classics import CLASSICS
from benchmarks.others import OTHERS
from benchmarks.problems import CONSERVATIVE, GENERAL, Problem, figure_eight
from benchmarks.systems import ERRORS, compile_solve
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
_STARTS = 12  # in a call, of problems that take less than a millisecond
_ROUNDS, _QUICK_ROUNDS = 8, 3
_SLOW = 5e-3  # [s] most runs take part in every round


def run(quick: bool = False) -> list[Curves]:
    """Times of the default and of every method that fits."""
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    # Not only the problem's name: other benchmarks have the same problem, and names are keys.
    return [curves(f"default: {name}", repeat(name), rounds) for name in PROBLEMS]


def curves(
    name: str, problem: Problem, rounds: int, tolerances: Sequence[float] = TOLERANCES
) -> Curves:
    """Error against time of the default and of the methods that fit a problem."""
    scene = problem.scene
    ways = {solver.name: compile_solve(problem, tolerances, solver) for solver in fitting(problem)}
    taken = list(dict.fromkeys(default_solver(scene, rtol=rtol).name for rtol in tolerances))
    if len(taken) == 1:  # not the same program twice
        ways.pop(taken[0])
    methods = {f"default, {' and '.join(taken)}": compile_solve(problem, tolerances)} | ways
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
        truth = compile_solve(problem, tolerances).build(1e-15)()
    # All except the pair, with whose compile time that of the default is compared.
    others = ways.keys() - {default_solver(scene, several=True).name}
    return work_precision(name, methods, truth, ERRORS, rounds, bars, others, _SLOW)


def repeat(name: str) -> Problem:
    """A problem with each of its starts as often as one call solves from it."""
    problem = PROBLEMS[name]()
    return problem._replace(y0s=np.repeat(problem.y0s, repeats(name), axis=0))


def repeats(name: str) -> int:
    """How often one call solves a problem from each of its starts."""
    return 1 if name in GENERAL else _STARTS


def fitting(problem: Problem) -> tuple[Solver, ...]:
    """Methods with a tolerance that fit the scene, for motions that are not stiff."""
    scene = problem.scene
    second = (NYSTROM12, STOERMER14, STOERMER18) if scene.second_order else ()
    series = (
        (TAYLOR8, TAYLOR12, TAYLOR14, TAYLOR16, TAYLOR20) if has_series(scene, scene.y0) else ()
    )
    return VERNER9, DOPRI8, *second, *series
