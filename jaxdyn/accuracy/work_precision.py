"""The cost of accuracy: error against time and right-hand sides, for any scene.

`work_precision` runs a scene with several solvers at many tolerances, and reports the time that
a given error takes, compile time apart. Errors are those of the end state, or of any other
quantity of the motion, see `quantities`. Methods are compared at equal error, never at equal
tolerance.
"""

import functools
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first, check_on_host
from jaxdyn._progress import each, report_progress
from jaxdyn.accuracy.quantities import END, Quantity
from jaxdyn.accuracy.timing import Times, at_error, interleave
from jaxdyn.integrate.errors import scales
from jaxdyn.integrate.simulation import solve
from jaxdyn.integrate.spans import RTOL, span
from jaxdyn.scene import Scene
from jaxdyn.solvers import (
    DOPRI8,
    RADAU5,
    RADAU9,
    STOERMER14,
    STOERMER18,
    TAYLOR12,
    TAYLOR14,
    VERNER9,
    Method,
    Solver,
    default_solver,
    has_series,
)
from jaxdyn.solvers.choice import method_of

TOLERANCES = tuple(float(f"1e-{n}") for n in range(3, 16))
#: Numbers of steps over the span, for a solver of fixed step.
STEPS = tuple(16 * 2**n for n in range(9))
_REFERENCE_RTOLS = (1e-15, 1e-14, 1e-13)  # tolerances of the reference, the finest that works
_ROUNDS = 30
_STIFFNESS_RTOL = 1e-6  # tolerance at which stiffness is tested


class Rung(NamedTuple):
    """A run: tolerance or step, relative error, wall time, steps, right-hand sides (or NaN)."""

    fineness: float
    error: float
    times: Times
    steps: int
    evaluations: float


class Curve(NamedTuple):
    """All runs of a solver.

    Attributes:
      solver: its name.
      compiling: compile time of the first run [s].
      rungs: the runs.
      adaptive: whether their fineness is a tolerance; else it is a step [s].
    """

    solver: str
    compiling: float
    rungs: tuple[Rung, ...]
    adaptive: bool


class Choice(NamedTuple):
    """A solver, its tolerance (or step), the error that it has then and the time [s] it takes."""

    solver: str
    fineness: float
    error: float
    seconds: float


class WorkPrecision(NamedTuple):
    """Error against time of several solvers.

    Attributes:
      quantity: name of the quantity whose errors are shown.
      uncertainty: relative error of the reference; smaller errors are not shown.
      curves: the curves, one for each solver.
    """

    quantity: str
    uncertainty: float
    curves: tuple[Curve, ...]

    def at(self, error: float) -> dict[str, Times]:
        """Times of all solvers at a relative error; NaN where it is not reached."""
        return {
            c.solver: at_error([r.error for r in c.rungs], [r.times for r in c.rungs], error)
            for c in self.curves
        }

    def recommend(self, digits: float) -> Choice | None:
        """The fastest run with this many digits; None if there is none."""
        fine = [
            Choice(solver=c.solver, fineness=r.fineness, error=r.error, seconds=r.times.median)
            for c in self.curves
            for r in c.rungs
            if r.error <= 10.0**-digits
        ]
        return min(fine, key=lambda choice: choice.seconds, default=None)

    def as_dict(self) -> dict:
        """The whole record, ready for JSON."""
        curves = [
            {
                "solver": c.solver,
                "compiling": c.compiling,
                "adaptive": c.adaptive,
                "rungs": [
                    {
                        "fineness": r.fineness,
                        "error": r.error,
                        "median": r.times.median,
                        "minimum": r.times.minimum,
                        "steps": r.steps,
                        "evaluations": _text.with_null(r.evaluations),
                    }
                    for r in c.rungs
                ],
            }
            for c in self.curves
        ]
        return {"quantity": self.quantity, "uncertainty": self.uncertainty, "curves": curves}


@check_first
def fit_solvers(scene: Scene, t1=None) -> tuple[Method, ...]:
    """Solvers with a tolerance that suit a scene: implicit ones where it is stiff.

    Extrapolation is included for velocity-independent forces, Taylor series where the scene's
    formulas are short, and what `simulate` takes by default, from loose to fine tolerances.
    """
    _, t1 = span(scene, t1)
    if bool(solve(scene, t1, rtol=_STIFFNESS_RTOL).stiff):
        return RADAU9, RADAU5
    extrapolated = (STOERMER14, STOERMER18) if scene.second_order else ()
    taylor = (TAYLOR12, TAYLOR14) if has_series(scene, scene.y0) else ()
    pair = default_solver(scene, several=True)
    defaults = (default_solver(scene, rtol=rtol) for rtol in (RTOL, TOLERANCES[0], TOLERANCES[-1]))
    usual = pair, *defaults, VERNER9, DOPRI8, *extrapolated, *taylor
    return tuple({solver.name: solver for solver in reversed(usual)}.values())[::-1]


@check_first
def work_precision(
    scene: Scene,
    t1=None,
    *,
    solvers: Sequence[Solver] | None = None,
    tolerances: Sequence[float] = TOLERANCES,
    steps: Sequence[int] = STEPS,
    quantity: Quantity = END,
    rounds: int = _ROUNDS,
    options: Mapping[str, Any] | None = None,
) -> WorkPrecision:
    """Error against time and right-hand sides of several solvers; host only.

    Args:
      scene: system, effects, start.
      t1: () end of the span [s]; the scene's own by default.
      solvers: the solvers; by default those that suit the scene.
      tolerances: relative tolerances, for solvers with a tolerance.
      steps: numbers of steps over the span, for solvers of fixed step.
      quantity: the quantity whose errors are shown. They are the largest over its entries, relative
        to the largest entry (for a state, of the same unit) unless its exact value is known.
      rounds: how many times to run everything.
      options: options of XLA's compiler for these programs, as `jax.jit` takes them.
    Returns:
      The curves, without runs that failed.
    Raises:
      ValueError: `solvers` is empty, or one of them does not suit the scene.
    Limits: a time is that of the compiled calculation with its call overhead of some 20 us.
    """
    check_on_host("scene", scene)
    t1 = float(span(scene, t1)[1])
    solvers = fit_solvers(scene, t1) if solvers is None else tuple(map(method_of, solvers))
    if not solvers:
        raise _checks.fail("solvers", "at least one", "none")
    programs = functools.cache(lambda solver: _program(scene, t1, solver, quantity, options))
    exact, scale, uncertainty = _reference(scene, quantity, solvers, programs)
    runs, compiling, values, counts = {}, {}, {}, {}
    for solver in solvers:
        grid = tolerances if solver.adaptive else [abs(t1) / n for n in steps]
        program, counter = programs(solver)
        report_progress(f"preparing {solver.name}")
        start = time.perf_counter()
        program(grid[0])
        compiling[solver] = time.perf_counter() - start
        for fineness in each(grid, f"solving with {solver.name}"):
            value = program(fineness)
            if np.isfinite(value).all():
                key = solver, fineness
                runs[key] = lambda program=program, fineness=fineness: program(fineness)
                values[key], counts[key] = value, counter(fineness)
    times = interleave(runs, rounds)

    def rung(key) -> Rung:
        error = max(float(np.max(np.abs(values[key] - exact) / scale)), uncertainty)
        tries = int(np.sum(counts[key]))
        return Rung(
            fineness=key[1],
            error=error,
            times=times[key],
            steps=int(counts[key][0]),
            evaluations=tries * key[0].evaluations,
        )

    curves = [
        Curve(
            solver=s.name,
            compiling=compiling[s],
            rungs=tuple(rung(key) for key in runs if key[0] is s),
            adaptive=s.adaptive,
        )
        for s in solvers
    ]
    return WorkPrecision(quantity.name, uncertainty, tuple(curves))


def _program(scene, t1: float, solver: Method, quantity: Quantity, options) -> tuple:
    """Functions of tolerance or step to the value and to counts, compiled at their first calls."""
    numbers, rest = eqx.partition(scene, eqx.is_array)

    def compiled(of: Callable) -> Callable:
        def value(numbers, t1, fineness):
            rtol, dt = (fineness, None) if solver.adaptive else (RTOL, fineness)
            return of(eqx.combine(numbers, rest), t1, solver=solver, rtol=rtol, dt=dt)

        run = jax.jit(value, compiler_options=options and dict(options))
        return lambda fineness: np.asarray(run(numbers, t1, fineness))

    if quantity is not END:
        return compiled(quantity.of), compiled(_counts)
    both = compiled(_end_and_counts)  # one program, which takes half as long to compile
    return lambda fineness: both(fineness)[:-2], lambda fineness: both(fineness)[-2:]


def _counts(scene, t1, *, solver, rtol, dt):
    result = solve(scene, t1, solver=solver, rtol=rtol, dt=dt)
    return jnp.stack([result.steps, result.rejected])


def _end_and_counts(scene, t1, *, solver, rtol, dt):
    result = solve(scene, t1, solver=solver, rtol=rtol, dt=dt)
    counts = jnp.stack([result.steps, result.rejected])
    return jnp.concatenate([result.y1, counts.astype(result.y1.dtype)])


def _reference(scene, quantity: Quantity, solvers, programs: Callable) -> tuple:
    """Exact value, scale of errors, and relative uncertainty of the value."""
    if quantity.exact is not None:
        return np.asarray(quantity.exact), 1.0, float(np.finfo(float).eps)
    stiff = RADAU9 in solvers or RADAU5 in solvers
    pair = (RADAU9, RADAU5) if stiff else (default_solver(scene, several=True), DOPRI8)
    found = [_finest(programs(solver)[0]) for solver in pair]
    value = found[0]
    if quantity is END:
        scale = scales(scene, np.stack([np.asarray(scene.y0), value]))
    else:
        scale = np.max(np.abs(value)) or 1.0
    difference = float(np.max(np.abs(value - found[1]) / scale))
    return value, scale, max(difference, float(np.finfo(float).eps))


def _finest(program) -> np.ndarray:
    for tolerance in _REFERENCE_RTOLS:
        value = program(tolerance)
        if np.isfinite(value).all():
            break
    return value
