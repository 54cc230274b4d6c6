"""The size of each entry of a motion's state: what everything about an orbit is measured in.

A closing error of 1e-5 is large for an atom in metres and nothing for a planet. So entries of the
state are compared in units of their sizes along the motion, and times in radians of the period, and
no verdict depends on the units in which a scene is written.

The size of an entry is its value at the start, or the change that its rate there makes in a radian
of the period's second harmonic, if that is larger. No motion has to be computed for that. Entries
of one group (`jaxdyn.scales`) have the same size. Without units an entry has at least the size of
what the others can do to it: near an equilibrium their effects cancel, and a velocity that is small
there has no size of its own.
"""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene
from jaxdyn._records.notes import notes_on
from jaxdyn.plan import plan_of
from jaxdyn.scales import at_rest, groups, with_one_more

#: Motions mostly have a few harmonics, which change faster than the first one.
_HARMONIC = 2
#: Of what other entries make of one: less is rounding.
_ROUNDING = 1e-9
#: Relative: numbers that differ by less are as large as each other.
_ALIKE = 1e-6
#: Times, as fractions of the span, at which the rate is asked, spread by the golden section: a
#: drive may be zero at most of them, and has the same phase at no two of them.
SPREAD = (np.arange(512) + 0.5) * (math.sqrt(5.0) - 1.0) / 2 % 1.0
#: Of them those at which the period of a drive is told.
PHASES = 4


@jax.jit
def rate(scene: Scene, t, y: Float[Array, " k"]) -> Float[Array, " k"]:
    """The scene's vector field, compiled; uncompiled it takes milliseconds."""
    return scene.rate(t, y)


@jax.jit
def rates_at(scene: Scene, ts: Array, y: Float[Array, " k"]) -> Array:
    """(s, k) the vector field at a state and several times."""
    return jax.vmap(lambda t: scene.rate(t, y))(ts)


def sizes(scene: Scene) -> np.ndarray:
    """(k,) the size of each entry along the motion of a scene from its start over its span."""
    notes = notes_on(scene)
    if notes is None:
        return _sizes(scene)
    if "sizes" not in notes:
        notes["sizes"] = _sizes(scene)
    return notes["sizes"].copy()


def times(scene: Scene) -> np.ndarray:
    """(s,) times in its span at which the rate is asked; one where it does not depend on time."""
    driven = plan_of(scene.field, len(scene.y0)).depends_on_time
    return (SPREAD if driven else SPREAD[:1]) * float(scene.t1)


def _sizes(scene: Scene) -> np.ndarray:
    y0, span = np.asarray(scene.y0), float(scene.t1)
    radian = span / (2 * math.pi * _HARMONIC)
    rates = np.abs(np.asarray(rates_at(scene, times(scene), y0)))
    rates = np.where(np.isfinite(rates), rates, 0.0).max(axis=0)
    found = coupled_sizes(scene, alike(scene, np.maximum(np.abs(y0), radian * rates)))
    if (found > 0).all():
        return found
    if not found.any():
        return sizes_at_rest(scene, y0)
    slope = np.asarray(_slope(scene, jnp.asarray(0.0), scene.y0))
    slope = np.abs(np.where(np.isfinite(slope), slope, 0.0))
    return _fill(scene, found, slope, radian)


def sizes_at_rest(scene: Scene, y: np.ndarray) -> np.ndarray:
    """(k,) the size of each entry near an equilibrium y (k,), where the rate is rounding."""
    return np.array(at_rest(scene.field, groups(scene.system), y).sizes)


def coupled_sizes(scene: Scene, each: np.ndarray) -> np.ndarray:
    """(k,) sizes of at least what the others make of an entry in the time of the motion's start.

    That time is 1 over the spectral radius of |J|, of the rate's Jacobian J there; at most the
    span, since a motion adds up no longer, also where J is nilpotent, as at a Bogdanov-Takens
    point. Where units say which entries are of one kind (`jaxdyn.scales`) these are measured by
    each other alone.
    """
    if groups(scene.system).known:
        return each
    slope = np.abs(np.asarray(_slope(scene, jnp.asarray(0.0), scene.y0)))
    slope = np.where(np.isfinite(slope), slope, 0.0)
    fastest = max(float(np.abs(np.linalg.eigvals(slope)).max()), 1 / float(scene.t1))
    for _ in range(len(each)):
        made = alike(scene, slope @ each / fastest)
        each = np.where(made > (1 + _ROUNDING) * each, made, each)
    return each


def sizes_along(scene: Scene, ys: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(k,) the sizes of entries that have known ones (k,) at a start, along its motion (s, k)."""
    return coupled_sizes(scene, np.maximum(known, alike(scene, np.abs(ys).max(axis=0))))


def alike(scene: Scene, each: np.ndarray) -> np.ndarray:
    """(k,) of numbers that are not negative, one for each entry, the largest of each group."""
    known = groups(scene.system)
    of, found = np.array(known.of), np.array(each, float)
    for group in range(max(known.of) + 1):
        found[of == group] = found[of == group].max()
    return np.minimum(found, known.most)


def largest_entry(vector: np.ndarray, each: np.ndarray) -> int:
    """The entry of a vector (k,) that is largest in sizes (k,); of several, the first."""
    size = np.abs(vector / each)
    return int(np.argmax(size > (1 - _ALIKE) * size.max()))


def _fill(scene: Scene, found: np.ndarray, slope: np.ndarray, time: float) -> np.ndarray:
    """The sizes, with those that are 0 from the others by what these change (k, k) in a time.

    Some are not. An entry that no other one moves has the size at which the rate's Jacobian changes
    by itself or by 1 over the time, which is decided on for one such entry after the other, and
    what follows from it.
    """
    made, y0 = time * slope, np.asarray(scene.y0)
    while (found == 0).any():
        new = np.where(found == 0, alike(scene, (made * found).max(axis=1)), found)
        if (new == found).all():
            own = functools.partial(alike, scene)
            new = with_one_more(scene.field, 0.0, y0, found, made, own, 1 / time)
        found = alike(scene, new)
    return found


@jax.jit
def _slope(scene: Scene, t: Array, y: Array) -> Array:
    return jax.jacfwd(scene.rate, argnums=1)(t, y)
