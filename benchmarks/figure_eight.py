"""How long does one period of the figure-eight take, at equal true error?

Run: ``python -m benchmarks figure-eight``. 12 numbers, one trajectory, one thread. The errors
are the largest of the 12 at the end, against a solution with 36 digits. Three ways to call us:
compiled into a program of the user's (`jaxdyn`), and the public `solve` and `simulate` from
Python with all they do around it. The right-hand side of SciPy is compiled by numba.
"""

import functools
from collections.abc import Mapping

import jax
import numpy as np

import jaxdyn
from benchmarks import _peers
from benchmarks._timing import Row, at_error, first_call, interleaved
from jaxdyn.scenes import three_body
from jaxdyn.simulate import solve

#: Wanted true errors.
ERRORS = (1e-6, 1e-9, 1e-12, 1e-14)
#: Half decades, for every method.
TOLERANCES = tuple(10.0**-e for e in np.arange(4.0, 16.5, 0.5))
_SCIPY_TOLERANCES = tuple(tol for tol in TOLERANCES if tol > 3e-14)  # its own limit
_ROUNDS, _QUICK_ROUNDS = 400, 20

#: (12,) the state after `EIGHT_PERIOD` of the motion that starts at `EIGHT`, both as rounded to
#: doubles: by heyoka with 36 digits, and the same to 29 by a Taylor method in mpmath.
END = (-0.9700043537551996167277, 0.2430875348094792091171)
END += (0.9700043651622223170579, -0.2430875241845393939293)
END += (-1.140702270033022399715e-8, -1.062493981518776497543e-8)
END += (-0.4662036997138093823578, -0.4323657265891969536779)
END += (-0.46620367104547072375, -0.432365733839738406252)
END += (0.9324073707592801061078, 0.86473146042893535993)


def run(quick: bool = False) -> list[Row]:
    """The rows of the table."""
    methods = ours()
    scene = three_body()
    y0, period = np.asarray(scene.y0), float(scene.t1)
    if _peers.importable("heyoka"):
        methods["heyoka"] = {tol: _peers.heyoka(y0, period, tol) for tol in TOLERANCES}
    methods["diffrax Dopri8"] = _partials(_peers.diffrax_dopri8(scene, period), TOLERANCES)
    if _peers.importable("scipy", "numba"):
        methods["SciPy DOP853"] = _partials(_peers.scipy_dop853(y0, period), _SCIPY_TOLERANCES)
    return compare(methods, _QUICK_ROUNDS if quick else _ROUNDS)


def ours(tolerances=TOLERANCES) -> dict[str, dict[float, _peers.Run]]:
    """Our three ways, at each tolerance."""
    scene = three_body()
    end = [float(scene.t1)]
    compiled = jax.jit(lambda scene, y0, tol: solve(scene.starting(y0), scene.t1, rtol=tol).y1)
    y0 = np.asarray(scene.y0)
    ways = {
        "jaxdyn": lambda tol: np.asarray(compiled(scene, y0, tol)),
        "jaxdyn solve": lambda tol: np.asarray(solve(scene, scene.t1, rtol=tol).y1),
        "jaxdyn simulate": lambda tol: np.asarray(
            jaxdyn.simulate(scene, samples=end, rtol=tol).ys[-1]
        ),
    }
    return {name: _partials(way, tolerances) for name, way in ways.items()}


def compare(methods: Mapping[str, Mapping[float, _peers.Run]], rounds: int) -> list[Row]:
    """A row for the first calls, and one for each of `ERRORS`."""
    first = {}
    for name, runs in methods.items():
        seconds = first_call(next(iter(runs.values())))
        first[name] = (seconds, seconds)
    errors = {
        (name, tol): float(np.max(np.abs(run() - np.array(END))))
        for name, runs in methods.items()
        for tol, run in runs.items()
    }
    runs = {(name, tol): run for name, runs in methods.items() for tol, run in runs.items()}
    times = interleaved(runs, rounds)
    rows = []
    for wanted in ERRORS:
        row = {}
        for name, tolerances in methods.items():
            keys = [(name, tol) for tol in tolerances]
            row[name] = at_error([errors[k] for k in keys], [times[k] for k in keys], wanted)
        rows.append(Row(f"figure-eight, error {wanted:.0e}", row))
    return rows


def _partials(way, tolerances) -> dict[float, _peers.Run]:
    return {tol: functools.partial(way, tol) for tol in tolerances}
