"""How long does the gradient of a loss take, in units of plain solves?

Run: ``python -m benchmarks gradient``. A sheet of nine points and 20 springs (36 numbers) over ten
periods of its slowest vibration. The loss is half the square of the end state; its gradient with
respect to the 20 stiffnesses is taken by `jax.grad`, at the tolerance of the plain solve: by the
adjoint equations, and by the variational equations with one column for each. Times are those of the
processor: a gradient takes long enough to be interrupted by other processes.

Last numbers (2 cores, 2026-11), in plain solves at tolerances of 1e-6, 1e-9, 1e-12: 7.1, 9.3, 9.6;
by columns 15, 20, 21.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks._timing import Row, Times, seconds_of
from benchmarks.ensembles import processor_times
from benchmarks.problems import sheet
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Scene

TOLERANCES = (1e-6, 1e-9, 1e-12)
PERIODS = 10
_BAR = 10.0
_ROUNDS, _QUICK_ROUNDS = 50, 3
_RIGID = 1e-6  # smaller eigenvalues belong to rigid motions


def run(quick: bool = False, periods: int = PERIODS, tolerances=TOLERANCES) -> list[Row]:
    """Times of the gradient and of plain solves, first runs by wall time."""
    scene = sheet().scene
    t1 = periods * slowest_period(scene)
    ways = {"gradient": gradient, "by columns": by_columns, "plain solve": end}
    compiling, runs = {}, {}
    for name, way in ways.items():
        program = jax.jit(way)
        for tol in tolerances:
            runs[name, tol] = lambda program=program, tol=tol: np.asarray(
                program(scene.effects[0].k, scene, t1, tol)
            )
        seconds = seconds_of(runs[name, tolerances[0]])
        compiling[name] = Times(seconds, seconds)
    times = processor_times(runs, _QUICK_ROUNDS if quick else _ROUNDS)
    rows = [Row("gradient of 20 numbers: first run", compiling)]
    for tol in tolerances:
        both = {name: times[name, tol] for name in ways}
        rows.append(Row(f"gradient of 20 numbers: rtol {tol:.0e}", both, {"plain solve": _BAR}))
    return rows


def end(k, scene: Scene, t1, tol, adjoint=False):
    """(36,) the end state for stiffnesses k (20,)."""
    springs = eqx.tree_at(lambda effect: effect.k, scene.effects[0], k)
    return solve(Scene(scene.system, (springs,), y0=scene.y0), t1, rtol=tol, adjoint=adjoint).y1


def gradient(k, scene: Scene, t1, tol, adjoint=True):
    """(20,) gradient of half the square of the end state."""

    def loss(k):
        y1 = end(k, scene, t1, tol, adjoint)
        return 0.5 * jnp.sum(y1 * y1)

    return jax.grad(loss)(k)


def by_columns(k, scene: Scene, t1, tol):
    """`gradient` by the variational equations, as without ``adjoint=True``."""
    return gradient(k, scene, t1, tol, adjoint=False)


def slowest_period(scene: Scene) -> float:
    """Longest period of the small vibrations of the sheet [s]."""
    rest = np.array([(i // 3, i % 3) for i in range(9)], float)
    springs, m = scene.effects[0], scene.system.m
    stiffness = jax.hessian(lambda r: springs.potential(0.0, r, m))(jnp.asarray(rest))
    squares = np.linalg.eigvalsh(np.asarray(stiffness).reshape(rest.size, rest.size))
    return float(2 * np.pi / np.sqrt(squares[squares > _RIGID].min()))
