"""How long does one period of the figure-eight take, at equal true error?

Run: ``python -m benchmarks figure-eight``. 12 numbers, one trajectory, one thread. The errors
are the largest of the 12 at the end, against a solution with 36 digits. Three ways to call us:
compiled into a user's program (`jaxdyn`), and the public `solve` and `simulate` from Python with
their overhead.

Last numbers (2 cores, 2026-11), minima, with ours over the other's in brackets: error 1e-6 42 us,
heyoka 29 (1.4); 1e-9 48 us, 49 (1.0), Dopri8 167 (0.29), DOP853 10500; 1e-12 60 us, 75 (0.80), 264
(0.23). Ours are by the extrapolated leapfrog; the Nystrom pair takes 1.0 to 1.3 times as long.
heyoka is given each pair of bodies once; with each pair written twice it takes 1.5 times as long,
its own `model.nbody` 1.2 times. diffrax runs here with loops folded by `jaxdyn.configure`. As
shipped, in a process of its own, its Dopri8 takes 460, 1000 and 2200 us to errors of 2e-7, 1e-10
and 1e-13: 27, 45 and 75 times as long as ours. 26 us of ours pass in a call that takes no step,
most of them in JAX: in one call of twelve periods (``python -m benchmarks default``) the ratios to
heyoka are 0.58, 0.46 and 0.40; `solve` from Python adds 100 us.
"""

from collections.abc import Sequence

import numpy as np

import jaxdyn
from benchmarks import systems
from benchmarks._timing import Curves, Method, work_precision
from benchmarks.problems import figure_eight
from benchmarks.systems import SCIPY, peers
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes import three_body

#: True errors compared at.
ERRORS = (1e-6, 1e-9, 1e-12, 1e-14)
#: Half decades, for every method.
TOLERANCES = tuple(10.0**-e for e in np.arange(4.0, 16.5, 0.5))
#: Those against heyoka, which the overhead of calls would dominate here, are in
#: `benchmarks.default_method`.
BARS = {
    "diffrax Dopri8": (0.1,) * 4,
    SCIPY: (0.02,) * 4,
}
_ROUNDS, _QUICK_ROUNDS = 200, 20

#: (12,) the state after `EIGHT_PERIOD` of the motion that starts at `EIGHT`, both as rounded to
#: doubles: by heyoka with 36 digits, and the same to 29 by a Taylor method in mpmath.
END = (-0.9700043537551996167277, 0.2430875348094792091171)
END += (0.9700043651622223170579, -0.2430875241845393939293)
END += (-1.140702270033022399715e-8, -1.062493981518776497543e-8)
END += (-0.4662036997138093823578, -0.4323657265891969536779)
END += (-0.46620367104547072375, -0.432365733839738406252)
END += (0.9324073707592801061078, 0.86473146042893535993)


def run(quick: bool = False) -> list[Curves]:
    """Times of every method that is installed; `quick` for a rough estimate."""
    methods = ours(TOLERANCES) | peers(figure_eight(), TOLERANCES)
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    truth = np.array([END])
    return [work_precision("figure-eight", methods, truth, ERRORS, rounds, BARS)]


def ours(tolerances: Sequence[float]) -> dict[str, Method]:
    """The default, compiled in, and two ways to call it."""
    scene = three_body()
    period, ts = float(scene.t1), np.array([scene.t1])
    ways = {
        "jaxdyn solve": lambda tol: np.asarray(solve(scene, period, rtol=tol).y1)[None],
        "jaxdyn simulate": lambda tol: jaxdyn.simulate(scene, samples=ts, rtol=tol).ys,
    }
    compiled = {"jaxdyn": systems.compile_solve(figure_eight(), tolerances)}
    return compiled | {name: Method(_blocking(way), tolerances) for name, way in ways.items()}


def _blocking(way):
    # Conversion to NumPy waits for the result, without a copy.
    return lambda tol: lambda: np.asarray(way(tol))
