"""What is the overhead of calls from Python, besides the steps that they take?

Run: ``python -m benchmarks calls``. The figure-eight: `solve` over a span of length zero, which
takes no step; `simulate` over a thousandth of its period, and over one period with 200 samples;
and making the scene. Beside them an empty program with the same scene as its argument, which is
the overhead of JAX itself, and `solve` within a compiled program.

Last numbers (2 cores, 2026-11), minima: an empty program takes 18 us; `solve` 3.3 of them more than
in a program, `simulate` 19 for a short motion and, with samples, 2.3 times the solve; making the
scene 6.6, of which its four arrays take 4. On a machine with an empty program of 10 us: 2.7, 19,
1.8 and 4.9.
"""

import jax
import numpy as np

from benchmarks._timing import Row, Times, interleave
from jaxdyn.integrate.simulation import simulate, solve
from jaxdyn.scene import Scene
from jaxdyn.scenes import three_body

#: Target ratios to empty programs, except for the samples: there to solves in a program.
_SOLVE, _SHORT, _MAKING, _SAMPLED = 3.0, 20.0, 5.0, 3.0
_SAMPLES = 200
_ROUNDS, _QUICK_ROUNDS = 2000, 20
_EMPTY, _INSIDE = "empty program", "solve in a program"


def run(quick: bool = False) -> list[Row]:
    """Times of calls, and of the reference programs."""
    scene = three_body()
    still, short = scene.starting(scene.y0, 0.0), scene.starting(scene.y0, scene.t1 / 1000)
    ts = np.linspace(0.0, float(scene.t1), _SAMPLES)

    @jax.jit
    def empty(scene: Scene):
        return scene.y0 + scene.effects[0].G * scene.system.m[0] * scene.t1

    @jax.jit
    def end(scene: Scene):
        return solve(scene, scene.t1).y1

    @jax.jit
    def sampled(scene: Scene):
        return solve(scene, scene.t1, ts=ts).ys

    runs = {
        "empty": lambda: np.asarray(empty(still)),
        "end": lambda: np.asarray(end(still)),
        "solve": lambda: np.asarray(solve(still, still.t1).y1),
        "short": lambda: np.asarray(simulate(short, samples=1).ys),
        "making": lambda: np.asarray(three_body().y0),
        "sampled": lambda: np.asarray(sampled(scene)),
        "simulate": lambda: np.asarray(simulate(scene, samples=_SAMPLES).ys),
    }
    found = interleave(runs, _QUICK_ROUNDS if quick else _ROUNDS)
    program = {_EMPTY: found["empty"]}
    bar = Times(*(a + _SOLVE * b for a, b in zip(found["end"], found["empty"], strict=True)))
    return [
        Row(
            "solve without steps, from Python",
            {"jaxdyn": found["solve"], _INSIDE: found["end"], **program, "the bar": bar},
            {"the bar": 1.0},
            f"the bar is {_SOLVE:g} empty programs more than in a program",
        ),
        Row(
            f"simulate, {_SAMPLES} samples",
            {"jaxdyn": found["simulate"], _INSIDE: found["sampled"]},
            {_INSIDE: _SAMPLED},
        ),
        Row("simulate, a short motion", {"jaxdyn": found["short"], **program}, {_EMPTY: _SHORT}),
        Row("making a scene", {"jaxdyn": found["making"], **program}, {_EMPTY: _MAKING}),
    ]
