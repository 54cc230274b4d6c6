"""The same problems for other integrators.

Peers are optional: `importable` prints a line for those that are missing.
"""

import functools
import importlib.util
from collections.abc import Callable
from typing import Any

import diffrax
import jax
import numpy as np

from benchmarks._timing import Run
from benchmarks.problems import Problem
from jaxdyn import Scene

_MAX_STEPS = 10_000_000  # diffrax's own limit is 4096


@functools.cache
def importable(*modules: str) -> bool:
    """Whether all of these can be imported; prints a line if not, once."""
    missing = [m for m in modules if importlib.util.find_spec(m) is None]
    if missing:
        print(f"left out: {' and '.join(missing)} not installed (pip install jaxdyn[benchmark])")
    return not missing


# ---- heyoka: Taylor series of an order chosen by the tolerance (Biscani, Izzo 2021)


def build_anew() -> None:
    """Make heyoka build each integrator anew; by default it caches them, also on disk."""
    if importable("heyoka"):
        import heyoka as hy

        hy.llvm_state.set_memcache_limit(0)
        if hasattr(hy.llvm_state, "set_diskcache_enabled"):  # older versions keep nothing on disk
            hy.llvm_state.set_diskcache_enabled(False)


def heyoka(problem: Problem, tol: float, *, compact: bool = False) -> Run:
    """The ends (n, k) of a problem; `compact` builds faster and runs more slowly."""
    return _heyoka_run(_heyoka(problem, tol, compact=compact), problem.y0s, problem.t1)


def heyoka_precise(problem: Problem) -> np.ndarray:
    """The ends (n, k) in 80-bit floats, rounded."""
    number = np.longdouble
    integrator = _heyoka(problem, 1e-18, number, compact=True)
    run = _heyoka_run(integrator, problem.y0s.astype(number), number(problem.t1))
    return run().astype(float)


def heyoka_monodromy(problem: Problem, tol: float, *, compact: bool, precise: bool = False) -> Run:
    """The derivative (k, k) of the end with respect to the start, by heyoka.

    Args:
      problem: of one start.
      tol: tolerance, of the state and the tangents together.
      compact: build in a second and run slower, instead of building for a minute.
      precise: in 80-bit floats, for a reference.
    """
    import heyoka as hy

    number = np.longdouble if precise else float
    k = problem.y0s.shape[1]
    equations = hy.var_ode_sys(_equations(problem.formulas, k), hy.var_args.vars, order=1)
    start = np.concatenate([problem.y0s[0], np.eye(k).ravel()]).astype(number)
    integrator = hy.taylor_adaptive(
        equations, start, tol=number(tol), compact_mode=compact, fp_type=number
    )
    run = _heyoka_run(integrator, start[None], number(problem.t1))
    return lambda: run()[0, k:].reshape(k, k)


def heyoka_batch(problem: Problem, lanes: int, tol: float, y0s: np.ndarray) -> np.ndarray:
    """Ends of many motions (n, k), n a multiple of `lanes`, by heyoka's batch mode."""
    k = y0s.shape[1]
    integrator = _heyoka_lanes(problem.formulas, k, lanes, tol)
    ends = []
    for start in y0s.reshape(-1, lanes, k):
        integrator.set_time(0.0)
        integrator.state[:] = start.T
        integrator.propagate_until(np.full(lanes, problem.t1))
        ends.append(integrator.state.T.copy())
    return np.concatenate(ends)


@functools.cache
def _heyoka_lanes(formulas: Callable, k: int, lanes: int, tol: float):
    import heyoka as hy

    return hy.taylor_adaptive_batch(_equations(formulas, k), np.zeros((k, lanes)), tol=tol)


def _heyoka(problem: Problem, tol: float, number: type = float, *, compact: bool = False):
    import heyoka as hy

    start = problem.y0s[0].astype(number)
    equations = _equations(problem.formulas, len(start))
    return hy.taylor_adaptive(
        equations, start, tol=number(tol), compact_mode=compact, fp_type=number
    )


def _equations(formulas: Callable, k: int) -> list:
    import heyoka as hy

    y = hy.make_vars(*(f"y{i}" for i in range(k)))
    return list(zip(y, formulas(hy)(y), strict=True))


def _heyoka_run(integrator, y0s: np.ndarray, t1) -> Run:
    zero = t1 * 0

    def run() -> np.ndarray:
        ends = []
        for y0 in y0s:
            integrator.time = zero
            integrator.state[:] = y0
            integrator.propagate_until(t1)
            ends.append(integrator.state.copy())
        return np.array(ends)

    return run


# ---- diffrax, with its defaults


def diffrax_run(
    problem: Any, solver: diffrax.AbstractSolver, tol: float, max_steps: int = _MAX_STEPS
) -> Run:
    """The ends (n, k) of a problem with `scene`, `y0s` and `t1`, compiled.

    NaN where it would take more than `max_steps` steps.
    """
    args = problem.scene.field, problem.y0s, problem.t1, tol
    return lambda: np.asarray(_diffrax(*args, solver=solver, max_steps=max_steps))


def diffrax_vmap(scene: Scene, tol: float, y0s: np.ndarray) -> np.ndarray:
    """Ends of many motions (n, k) by vmap of diffrax.Dopri8."""
    return np.asarray(_diffrax_vmap(scene.field, y0s, float(scene.t1), tol))


@functools.partial(jax.jit, static_argnames=("solver", "max_steps"))
def _diffrax(field, y0s, t1, tol, *, solver, max_steps):
    return one_by_one(lambda y0: _diffrax_one(field, y0, t1, tol, solver, max_steps), y0s)


@jax.jit
def _diffrax_vmap(field, y0s, t1, tol):
    return jax.vmap(lambda y0: _diffrax_one(field, y0, t1, tol, diffrax.Dopri8()))(y0s)


def _diffrax_one(field, y0, t1, tol, solver, max_steps=_MAX_STEPS):
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, field: field.rate(t, y)),
        solver,
        0.0,
        t1,
        None,
        y0,
        args=field,
        stepsize_controller=diffrax.PIDController(rtol=tol, atol=tol),
        max_steps=max_steps,
        throw=False,
    )
    assert solution.ys is not None
    reached = solution.result == diffrax.RESULTS.successful
    return jax.numpy.where(reached, solution.ys[-1], jax.numpy.nan)


def one_by_one(solve: Callable, y0s):
    """The ends (n, k) from starts (n, k), sequentially, in a traced program."""
    # The compiler does not remove a loop of one round.
    return solve(y0s[0])[None] if len(y0s) == 1 else jax.lax.map(solve, y0s)


# ---- SciPy, with a right-hand side compiled by numba


def scipy_dop853(problem: Problem, tol: float) -> Run:
    """The ends (n, k) of a problem by DOP853."""
    from scipy.integrate import solve_ivp

    rate, span = _numba_rate(problem.formulas), (0.0, problem.t1)

    def one(y0):
        return solve_ivp(rate, span, y0, "DOP853", rtol=tol, atol=tol).y[:, -1]

    return lambda: np.array([one(y0) for y0 in problem.y0s])


@functools.cache
def _numba_rate(formulas: Callable):
    import numba

    numbers = numba.njit(formulas(np))
    return numba.njit(lambda t, y: np.array(numbers(y)))
