"""Chaos: the time until which digits can be trusted, against motions in high precision.

The motions in high precision were computed with 80 digits by tests/references/chaos_reference.py.
"""

import functools
import json
import math
from collections.abc import Callable
from importlib import resources

import numpy as np

from jaxdyn.accuracy.horizon import trusted_time
from jaxdyn.hard.case import Case, Figure
from jaxdyn.integrate.errors import gaps, scales
from jaxdyn.scene import Scene
from jaxdyn.scenes.nbody import three_body
from jaxdyn.scenes.pendula import double_pendulum, triple_pendulum

_FILE = resources.files("jaxdyn").joinpath("data").joinpath("chaos_reference.json")
_DIGITS = (3, 6)
_TOLERANCES = (1e-10, 1e-13)
_SHORT = 0.1  # allowed relative error of the reported time


def perturbed_eight() -> Scene:
    """Three equal bodies on the figure eight, the first moved by 0.05 along x."""
    x, y, u, v = 0.97000436, 0.24308753, 0.93240737, 0.86473146
    bodies = (-x + 0.05, y, x, -y, 0.0, 0.0)
    return three_body((*bodies, -u / 2, -v / 2, -u / 2, -v / 2, u, v))


def reference(name: str) -> tuple[np.ndarray, np.ndarray]:
    """The times (s,) and states (s, k) of a motion in high precision, rounded to doubles."""
    found = json.loads(_FILE.read_text())[name]
    states = np.array(found["states"], float)
    return np.linspace(0.0, found["t1"], len(states)), states


def true_time(scene: Scene, ys: np.ndarray, name: str, digits: float) -> float:
    """The time [s] up to which states (s, k) at the reference times have that many digits."""
    ts, exact = reference(name)
    off = np.abs(gaps(scene, ys, exact)) / scales(scene, exact)
    wrong = off.max(axis=1) > 10.0**-digits
    return float(ts[max(int(np.argmax(wrong)) - 1, 0)]) if wrong.any() else float(ts[-1])


def _figures(make: Callable[[], Scene], name: str) -> tuple[Figure, ...]:
    ts, _ = reference(name)
    scene, figures = make(), []
    for rtol in _TOLERANCES:
        for digits in _DIGITS:
            trust = trusted_time(scene, ts[-1], samples=ts, rtol=rtol, digits=digits)
            true = true_time(scene, np.asarray(trust.estimate.ys), name, digits)
            late = float(max(0.0, abs(trust.t - true) - ts[1]) / true)
            words = f"{digits} digits at rtol {rtol:g}"
            figures += [
                Figure(f"{words}: error of the reported time", late, _SHORT),
                Figure(f"{words}: right up to [s]", true),
            ]
    return (
        *figures,
        Figure("growth of differences [1/s]", trust.growth),
        Figure("no growth found", float(not trust.growth > 0 or math.isnan(trust.growth)), 0),
    )


CASES = (
    Case(
        "chaos-double",
        "The time to which digits of a double pendulum can be trusted is reported, and right.",
        functools.partial(_figures, double_pendulum, "double"),
    ),
    Case(
        "chaos-triple",
        "The time to which digits of a triple pendulum can be trusted is reported, and right.",
        functools.partial(_figures, triple_pendulum, "triple"),
    ),
    Case(
        "chaos-eight",
        "The time to which digits of a perturbed eight can be trusted is reported, and right.",
        functools.partial(_figures, perturbed_eight, "eight"),
    ),
)
