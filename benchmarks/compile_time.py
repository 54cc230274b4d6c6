"""How long does the first result of a scene take, and the first derivative?

Run: ``python -m benchmarks compile-time``. Times of tracing, compiling and a very short first run,
without caches, for the composed double and triple pendulum, and for the slowest ready-made scene,
which is searched among the scenes with the longest rates.

Last numbers (2 cores, 2026-11): double pendulum 1.5 s and 1.0 s, triple pendulum 0.7 s and 1.7 s;
the slowest of the zoo, a rolling disk, 3.2 s and 6.0 s.
"""

from collections.abc import Iterable

import jax
import numpy as np

from benchmarks._timing import Row, Times, seconds_of
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes import catalogue
from jaxdyn.solvers.method import operations

_SPAN = 1e-3  # [s]
_SOLVE_BAR, _DERIVATIVE_BAR = 5.0, 8.0  # [s]
_SHOWN = ("double_pendulum", "triple_pendulum")
_LONGEST = 10  # scenes


def run(quick: bool = False) -> list[Row]:
    """Seconds of the pendulums, and of the slowest scene; `quick` for the pendulums alone."""
    names = _SHOWN if quick else dict.fromkeys((*_SHOWN, *longest(_LONGEST)))
    seconds = first_results(names)
    rows = [_row(name, *seconds[name]) for name in _SHOWN]
    if not quick:
        for i, what in enumerate(("solve", "derivative")):
            slowest = max(seconds, key=lambda name: seconds[name][i])
            rows.append(_row(f"slowest {what}, {slowest}", *seconds[slowest]))
    return [row for pair in rows for row in pair]


def longest(n: int) -> list[str]:
    """The n scenes of the zoo whose rates have the most operations."""
    scenes = {name: entry.make() for name, entry in catalogue.entries().items()}
    length = {name: operations(scene.field.rate, 0.0, scene.y0) for name, scene in scenes.items()}
    return sorted(length, key=length.__getitem__)[-n:]


def first_results(names: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Seconds until the end state and until its derivative by the start, by scene."""
    zoo = catalogue.entries()
    seconds = {}
    for name in names:
        scene = zoo[name].make()
        jax.clear_caches()
        solving = seconds_of(lambda scene=scene: np.asarray(solve(scene, _SPAN).y1))
        derivative = jax.jit(
            lambda scene: jax.jacfwd(lambda y0: solve(scene.starting(y0), _SPAN).y1)(scene.y0)
        )
        jax.clear_caches()
        seconds[name] = (
            solving,
            seconds_of(lambda scene=scene, run=derivative: np.asarray(run(scene))),
        )
    return seconds


def _row(name: str, solving: float, derivative: float) -> list[Row]:
    bars = (("solve", solving, _SOLVE_BAR), ("derivative", derivative, _DERIVATIVE_BAR))
    return [
        Row(
            f"{name}: first {what}",
            {"jaxdyn": Times(seconds, seconds), "the bar": Times(bar, bar)},
            {"the bar": 1.0},
        )
        for what, seconds, bar in bars
    ]
