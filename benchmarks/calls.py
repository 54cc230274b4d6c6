"""What is the overhead of a call of a compiled solve, besides its steps?

Run: ``python -m benchmarks calls``. The figure-eight over a span of length zero, which takes no
step: compiled into a user's program, by `solve` from Python, and an empty program with the
same arguments, which is the overhead of JAX itself.

Last numbers (2 cores with other work on them, 2026-11), minima: 15 us compiled, 54 us by `solve`,
11 us for the empty program.
"""

import jax
import numpy as np

from benchmarks._timing import Row, Times, interleaved
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes import three_body

_BAR = 15e-6  # [s]
_ROUNDS, _QUICK_ROUNDS = 2000, 20


def run(quick: bool = False) -> list[Row]:
    """Times of calls that take no step."""
    scene = three_body(t1=0.0)

    @jax.jit
    def compiled(scene):
        return solve(scene, scene.t1).y1

    @jax.jit
    def empty(scene):
        return scene.y0 + scene.effects[0].G * scene.system.m[0] * scene.t1

    runs = {
        "jaxdyn": lambda: np.asarray(compiled(scene)),
        "jaxdyn solve": lambda: np.asarray(solve(scene, scene.t1).y1),
        "empty program": lambda: np.asarray(empty(scene)),
    }
    times = interleaved(runs, _QUICK_ROUNDS if quick else _ROUNDS)
    times["the bar"] = Times(_BAR, _BAR)
    return [Row("a call", times, {"the bar": 1.0})]
