"""How long do other systems take at equal true error?

Run: ``python -m benchmarks systems``. Where no force depends on velocity: ten turns of a Kepler
orbit with e = 0.9, a sheet of nine points and 20 springs, the potential of Henon and Heiles.
Others: throws with quadratic drag, a double pendulum, a free rigid body, van der Pol's oscillator,
in runs of a millisecond and more; heyoka is called once per throw, which costs it 2 us. One
thread; errors are the largest at the end, relative to the largest number of the state, against
heyoka in 80-bit floats. diffrax is given our scenes, the others the formulas in
`benchmarks.problems`.

Ours is the default; `benchmarks.default_method` has our other solvers beside it. Last numbers (2
cores, 2026-11): ours over heyoka's (minima) at errors of 1e-6, 1e-9, 1e-12: Kepler 0.83, 0.74,
0.80; springs 0.38, 0.20, 0.17; Henon-Heiles 0.71, 0.81, 0.86; cannonball 0.58, 0.63, 0.70; double
pendulum 0.99, 0.99, 0.77; rigid body 0.88, 0.90, none; van der Pol 0.63, 0.66, 0.68. diffrax's
Dopri8 takes 2 to 13 times as long as ours, SciPy 90 to 3300 times.
"""

import functools
from collections.abc import Sequence

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import _peers
from benchmarks._timing import Curves, Method, work_precision
from benchmarks.problems import CONSERVATIVE, GENERAL, Problem
from jaxdyn.integrate.simulation import solve
from jaxdyn.solvers import default_solver

#: True errors compared at.
ERRORS = (1e-6, 1e-9, 1e-12)
#: Decades; heyoka needs up to ten seconds to build each of its integrators.
TOLERANCES = tuple(float(f"1e-{e}") for e in range(4, 16))
SCIPY = "SciPy DOP853"
_SCIPY_FINEST = 3e-14  # it refuses smaller ones
_TO_HEYOKA, _TO_DIFFRAX, _TO_SCIPY = 1.0, 0.2, 1.0
_ROUNDS, _QUICK_ROUNDS = 15, 3


def run(quick: bool = False) -> list[Curves]:
    """Times of every method that is installed; `quick` for a rough estimate."""
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    problems = CONSERVATIVE | GENERAL
    return [curves(name, make(), rounds, TOLERANCES) for name, make in problems.items()]


def curves(name: str, problem: Problem, rounds: int, tolerances: Sequence[float]) -> Curves:
    """Error against time of all methods for one problem."""
    methods = {"jaxdyn": compile_solve(problem, tolerances)} | peers(problem, tolerances)
    if _peers.importable("heyoka"):
        truth = _peers.heyoka_precise(problem)
    else:
        truth = compile_solve(problem, tolerances).build(1e-15)()
    bars = {"heyoka": _TO_HEYOKA, "diffrax Dopri8": _TO_DIFFRAX, "diffrax Tsit5": _TO_DIFFRAX}
    bars[SCIPY] = _TO_SCIPY
    bars = {method: (bar,) * len(ERRORS) for method, bar in bars.items()}
    return work_precision(name, methods, truth, ERRORS, rounds, bars)


def compile_solve(problem: Problem, tolerances: Sequence[float], solver=None) -> Method:
    """One of our methods, compiled into a user's program, with the scene's numbers as constants.

    The others also get formulas with these numbers. Without a solver it is the default for each
    tolerance.
    """
    scene, y0s = problem.scene, problem.y0s

    @functools.partial(jax.jit, static_argnames="method")
    def ends(y0s, tol, method):
        def end(y0):
            start = scene.starting(y0)
            return solve(start, scene.t1, rtol=tol, solver=method, fixed=True).y1

        return _peers.one_by_one(end, y0s)

    def build(tol):
        # The others know the tolerance at build time, too.
        known = jnp.asarray(tol)
        method = default_solver(scene, rtol=tol) if solver is None else solver
        return lambda: np.asarray(ends(y0s, known, method=method))

    return Method(build, tolerances)


def peers(problem: Problem, tolerances: Sequence[float]) -> dict[str, Method]:
    """The other methods that are installed."""
    methods = {}
    if _peers.importable("heyoka"):
        methods["heyoka"] = Method(functools.partial(_peers.heyoka, problem), tolerances)
    for solver in (diffrax.Dopri8(), diffrax.Tsit5()):
        build = functools.partial(_peers.diffrax_run, problem, solver)
        methods[f"diffrax {type(solver).__name__}"] = Method(build, tolerances)
    if _peers.importable("scipy", "numba"):
        coarse = [tol for tol in tolerances if tol > _SCIPY_FINEST]
        methods[SCIPY] = Method(functools.partial(_peers.scipy_dop853, problem), coarse)
    return methods
