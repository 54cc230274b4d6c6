"""How long does the monodromy matrix of the figure-eight take, at equal true error?

Run: ``python -m benchmarks monodromy``. The 12 numbers of the motion and 12 tangents of 12 over
one period, errors relative to the largest entry (17), against heyoka in 80-bit floats. heyoka
needs about a minute to build each of its integrators for speed; ``--quick`` takes its compact
form, which is slower to run.

Last numbers (2 shared cores, 2026-11), minima, error 1e-12: 0.60 ms, heyoka 2.4 ms
(0.25); building and first run 4 s against 84 s.
"""

import functools

import jax
import numpy as np

from benchmarks import _peers
from benchmarks._timing import Method, Row, work_precision
from jaxdyn.scenes import three_body
from jaxdyn.simulate import solve
from orbits.monodromy import monodromy

#: Wanted true error.
ERRORS = (1e-12,)
TOLERANCES = tuple(10.0**-e for e in np.arange(10.0, 15.5, 0.5))
#: heyoka's errors at these lie on both sides of the wanted one.
_HEYOKA_TOLERANCES = (1e-11, 1e-12, 1e-13)
_REFERENCE_TOLERANCE = 1e-18
_ROUNDS, _QUICK_ROUNDS = 300, 20


def run(quick: bool = False) -> list[Row]:
    """Times of ours and of heyoka; nothing without heyoka, which gives the truth."""
    if not _peers.importable("heyoka"):
        return []
    scene = three_body()
    y0, period = np.asarray(scene.y0), float(scene.t1)
    heyoka = functools.partial(_peers.heyoka_monodromy, y0, period)
    truth = heyoka(_REFERENCE_TOLERANCE, compact=True, precise=True)().astype(float)

    @jax.jit
    def compiled(scene, y0, tol):
        return jax.jacfwd(lambda y: solve(scene.starting(y), period, rtol=tol).y1)(y0)

    methods = {
        "jaxdyn": lambda tol: lambda: np.asarray(compiled(scene, y0, tol)),
        "jaxdyn monodromy": lambda tol: lambda: np.asarray(monodromy(scene, rtol=tol)),
    }
    methods = {name: Method(build, TOLERANCES) for name, build in methods.items()}
    methods["heyoka"] = Method(functools.partial(heyoka, compact=quick), _HEYOKA_TOLERANCES)
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    return work_precision("monodromy", methods, truth, ERRORS, rounds)
