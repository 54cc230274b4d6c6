"""Motions that are computed in 32-bit floats, for `jaxdyn/test_narrow.py`: in a process of its own.

Within one process JAX keeps programs and constants of both widths, and mixes them.
"""

import json
import warnings
from collections.abc import Callable, Sequence

import diffrax
import jax
import numpy as np

import jaxdyn
from jaxdyn import effects, ensemble, scenes
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Scene
from jaxdyn.solvers import VERNER9, to_diffrax

_SAMPLES = 50


def stiff() -> Scene:
    """Van der Pol's oscillator, for which an explicit method takes 1e5 steps."""

    def rate(t, y, mu):
        return [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]]

    return jaxdyn.ode(rate, [2.0, -0.67], 1.0, params=1e5)


def test_particle() -> Scene:
    """A body, and one without mass in its gravity."""
    y0 = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.1]
    return Scene(FreePoints([1.0, 0.0]), (effects.PairGravity(1.0),), y0=y0, t1=6.0)


def pushed_particle() -> Scene:
    """The same where a force begins to act on what has no mass, which ends the motion."""
    return test_particle() + effects.StepForce([0.0, 1e-3], t_on=2.0)


def many(rtol: float) -> np.ndarray:
    """(n, k) ends of motions that are stepped side by side."""
    scene = scenes.pendulum()
    starts = np.asarray(scene.y0) * np.linspace(0.5, 1.0, 5)[:, None]
    return np.asarray(ensemble.run(scene, starts, 3.0, rtol=rtol).y1)


def derivative(rtol: float) -> np.ndarray:
    """() of where a ball is by its drag."""

    def reach(drag):
        scene = scenes.cannonball() + effects.QuadraticDrag(drag)
        return jaxdyn.solve(scene, 1.0, rtol=rtol).y1[0]

    return np.asarray(jax.grad(reach)(0.1))


def by_diffrax(rtol: float) -> np.ndarray:
    """(1, k) end of a motion that diffrax computes with a method of ours."""
    scene, control = scenes.pendulum(), diffrax.PIDController(rtol, rtol)
    method = to_diffrax(VERNER9)
    run = diffrax.diffeqsolve(
        scene.term(), method, 0.0, 1.0, 0.1, scene.y0, stepsize_controller=control
    )
    return np.asarray(run.ys)


def _simulated(make: Callable[[], Scene]) -> Callable[[float], np.ndarray]:
    def states(rtol):
        return np.asarray(jaxdyn.simulate(make(), rtol=rtol, samples=_SAMPLES, throw=False).ys)

    return states


#: What is computed with a tolerance, by name.
MOTIONS: dict[str, Callable[[float], np.ndarray]] = {
    make.__name__: _simulated(make)
    for make in (
        scenes.cannonball,
        scenes.pendulum,
        scenes.three_body,
        scenes.henon_heiles,
        scenes.power_law,
        scenes.shaken_pendulum,
        scenes.restricted_three_body,
        stiff,
        test_particle,
        pushed_particle,
    )
} | {call.__name__: call for call in (many, derivative, by_diffrax)}


def show(names: Sequence[str], rtol: float) -> None:
    """Print numbers, their type and the warnings of motions by name, as JSON."""
    found = {}
    for name in names:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            values = MOTIONS[name](rtol)
        texts = sorted({str(one.message) for one in told})
        found[name] = {"values": values.tolist(), "type": str(values.dtype), "warned": texts}
    print(json.dumps(found))
