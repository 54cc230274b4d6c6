"""Scenes rewritten in other units, for tests that no unit matters."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

import jaxdyn
from jaxdyn.scene import Scene


class Rewritten(NamedTuple):
    """A scene in other units: the new state is `y` times the old one, the new time `t` times."""

    scene: Scene
    y: np.ndarray
    t: float


def rewritten(scene: Scene, seed: int, decades: float = 12.0) -> Rewritten:
    """A plain ODE with each entry and the time in a unit of its own, by up to so many decades."""
    random = np.random.default_rng(seed)
    y = 10.0 ** random.uniform(-decades, decades, len(scene.y0))
    return in_units(scene, y, float(10.0 ** random.uniform(-decades, decades)))


def in_units(scene: Scene, y, t: float) -> Rewritten:
    """A scene whose state is multiplied by `y` and whose time by `t`, as a plain ODE."""
    y = np.asarray(y, float)

    def rate(time, state, params):
        field, y, t = params
        return field.rate(time / t, state / y) * (y / t)

    params = scene.field, jnp.asarray(y), jnp.asarray(t)
    # Names, but not units, which would be wrong.
    names = [name for name, _ in scene.labels()]
    second = scene.second_order and _two_units(y, t)
    new = jaxdyn.ode(
        rate, scene.y0 * y, float(scene.t1) * t, names=names, params=params, second_order=second
    )
    return Rewritten(new, y, t)


def _two_units(y: np.ndarray, t: float) -> bool:
    q, v = np.split(y, 2)
    return bool(np.allclose(v, q / t, rtol=1e-12))
