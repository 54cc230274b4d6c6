"""The size of each entry of a motion's state: what everything about an orbit is measured in.

A closing error of 1e-5 is large for an atom in metres and nothing for a planet. So entries of the
state are compared in units of their sizes along the motion, and times in units of the period, and
no verdict depends on the units in which a scene is written.

The size of an entry is its value at the start, or the change that its rate there makes in a radian
of the period, if that is larger: of a harmonic oscillation both are its amplitude. Entries with
the same unit have the same size; those without one ("1") each have their own, but for the places
and velocities of a system of second order. An entry that rests at 0 has the size of what the others
can do to it.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene

#: Times, as fractions of the span, at which the rate is asked: a drive may be zero at one of them.
#: No simple fractions of each other, so that no drive has the same phase at all of them.
TIMES = (0.0, 0.13, 0.37, 0.71)


@jax.jit
def rate(scene: Scene, t, y: Float[Array, " k"]) -> Float[Array, " k"]:
    """The scene's vector field, compiled; uncompiled it takes milliseconds."""
    return scene.rate(t, y)


def sizes(scene: Scene) -> np.ndarray:
    """(k,) the size of each entry along the motion of a scene from its start over its span."""
    y0, span = np.asarray(scene.y0), float(scene.t1)
    radian = span / (2 * math.pi)
    rates = np.abs([np.asarray(rate(scene, share * span, y0)) for share in TIMES])
    rates = np.where(np.isfinite(rates), rates, 0.0).max(axis=0)
    found = alike(scene, np.maximum(np.abs(y0), radian * rates))
    if (found > 0).all():
        return found
    return _filled(scene, found, radian)


def alike(scene: Scene, each: np.ndarray) -> np.ndarray:
    """(k,) of positive numbers, one for each entry, the largest for entries of the same unit."""
    # Not the labels of the scene, which has none where its effects are without units.
    units = [unit for _, unit in scene.system.labels()]
    half = len(units) // 2
    if scene.system.second_order:
        units = [unit if unit != "1" else f"1 {i // half}" for i, unit in enumerate(units)]
    kinds = np.array([str(i) if unit == "1" else unit for i, unit in enumerate(units)])
    found = np.array(each, float)
    for kind in set(kinds.tolist()):
        found[kinds == kind] = found[kinds == kind].max()
    return found


def _filled(scene: Scene, found: np.ndarray, radian: float) -> np.ndarray:
    """The sizes, with those that are 0 from the others by the rate's derivatives.

    An entry on which no other one acts has no size: 1 then, and what follows from it.
    """
    slope = np.asarray(_slope(scene, jnp.asarray(0.0), scene.y0))
    slope = radian * np.abs(np.where(np.isfinite(slope), slope, 0.0))
    while (found == 0).any():
        moved = alike(scene, (slope * found).max(axis=1))
        new = np.where(found == 0, moved, found)
        if (new == found).all():
            new = np.where(np.arange(len(found)) == np.argmin(found), 1.0, found)
        found = alike(scene, new)
    return found


@jax.jit
def _slope(scene: Scene, t: Array, y: Array) -> Array:
    return jax.jacfwd(scene.rate, argnums=1)(t, y)
