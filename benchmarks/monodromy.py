"""How long does the monodromy matrix of the figure-eight take, at equal true error?

Run: ``python -m benchmarks monodromy``. The 12 numbers of the motion and 12 tangents of 12 over
one period, errors relative to the largest entry (17), against heyoka in 80-bit floats. heyoka
needs about a minute to build each of its integrators for speed; ``--quick`` takes its compact
form, which is slower to run.

Last numbers (2 cores, 2026-11), minima, error 1e-12: 0.74 ms, heyoka 2.9 ms (0.25); building and
first run 2.5 s, of heyoka 44 s.
"""

import functools
from collections.abc import Sequence

import jax
import numpy as np

from benchmarks import _peers
from benchmarks._timing import Curves, Method, work_precision
from benchmarks.problems import figure_eight
from jaxdyn.analysis.monodromy import monodromy
from jaxdyn.integrate.simulation import solve

#: True error compared at.
ERRORS = (1e-12,)
BARS = {"heyoka": (0.25,)}
TOLERANCES = tuple(10.0**-e for e in np.arange(10.0, 15.5, 0.5))
#: heyoka's errors at these are on both sides of that error.
_HEYOKA_TOLERANCES = (1e-11, 1e-12, 1e-13)
_REFERENCE_TOLERANCE = 1e-18
_ROUNDS, _QUICK_ROUNDS = 300, 20


def run(quick: bool = False) -> list[Curves]:
    """Times of ours and of heyoka; nothing without heyoka, which gives the truth."""
    if not _peers.importable("heyoka"):
        return []
    heyoka = functools.partial(_peers.heyoka_monodromy, figure_eight())
    truth = heyoka(_REFERENCE_TOLERANCE, compact=True, precise=True)().astype(float)
    methods = ours(TOLERANCES)
    methods["heyoka"] = Method(functools.partial(heyoka, compact=quick), _HEYOKA_TOLERANCES)
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    return [work_precision("monodromy", methods, truth, ERRORS, rounds, BARS)]


def ours(tolerances: Sequence[float]) -> dict[str, Method]:
    """Compiled into a user's program, and the public function."""
    scene = figure_eight().scene

    @jax.jit
    def compiled(scene, tol):
        def end(y):
            return solve(scene.starting(y), scene.t1, rtol=tol).y1

        return jax.jacfwd(end)(scene.y0)

    methods = {
        "jaxdyn": lambda tol: lambda: np.asarray(compiled(scene, tol)),
        "jaxdyn monodromy": lambda tol: lambda: np.asarray(monodromy(scene, rtol=tol)),
    }
    return {name: Method(build, tolerances) for name, build in methods.items()}
