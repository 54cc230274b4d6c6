"""The size of each entry of a motion's state, in which everything about an orbit is measured.

A closing error of 1e-5 is large for an atom in metres and nothing for a planet. So entries of the
state are compared in units of their sizes along the motion, and times in radians of the period, so
that no verdict depends on the units in which a scene is written.

The size of an entry is its value at the start, or the change that its rate there makes in a radian
of the period's second harmonic, if that is larger. No motion has to be computed for that. Entries
of one group (`jaxdyn.scales`) have the same size. Where units do not give the groups, the size of
an entry is at least the effect that the others can have on it: near an equilibrium their effects
cancel, and a velocity that is small there has no size of its own. Where units do give them, a small
share of that effect is enough; it matters near an equilibrium far from the origin, as L4 in km.
A start almost at rest has the sizes of one at rest, which follow from the entries that move it.
Without units, an entry that is hardly larger than its rounding error, as a mode that symmetry keeps
at zero, has no size of its own either: it gets the size that it would have if it were zero.
"""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene
from jaxdyn._records import notes_on
from jaxdyn.analysis.scales_at_rest import RateNear, at_rest
from jaxdyn.plan import plan_of
from jaxdyn.scales import groups, shifted

#: Motions mostly have a few harmonics, which change faster than the first one.
_HARMONIC = 2
#: Relative changes of a size below this, by the effect of other entries, are rounding.
_ROUNDING = 1e-9
#: Least ratio of an entry's size to its rounding error: closing errors are to be that small.
_RESOLVED = 1e12
#: Where units are known, an entry's size is at least this share of the effect of the others on it.
_SHARE = 0.01
#: A group is almost at rest if it is smaller at the start than this share of the change that its
#: rate makes.
_REST = 1e-3
#: Numbers that differ by less than this, relatively, count as equally large.
_ALIKE = 1e-6
#: Times, as fractions of the span, at which the rate is evaluated, spread by the golden section: a
#: drive may be zero at most of them, and has the same phase at no two of them.
SPREAD = (np.arange(512) + 0.5) * (math.sqrt(5.0) - 1.0) / 2 % 1.0
#: Number of phases at which a drive is compared with itself a period later.
PHASES = 4


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
    """(s,) times in the span at which the rate is evaluated; one where it is autonomous."""
    driven = plan_of(scene.field, len(scene.y0)).depends_on_time
    return (SPREAD if driven else SPREAD[:1]) * float(scene.t1)


def _sizes(scene: Scene) -> np.ndarray:
    y0, span = np.asarray(scene.y0), float(scene.t1)
    radian = span / (2 * math.pi * _HARMONIC)

    def most(y: np.ndarray) -> np.ndarray:
        rates = np.abs(np.asarray(rates_at(scene, times(scene), y)))
        return np.where(np.isfinite(rates), rates, 0.0).max(axis=0)

    at_start, by_rate = alike(scene, np.abs(y0)), alike(scene, radian * most(y0))
    found = np.maximum(at_start, by_rate)
    if groups(scene.system).known:
        if ((0 < at_start) & (at_start < _REST * by_rate)).any():
            # Rates that a group almost at rest causes are small only at the start.
            found = np.maximum(found, alike(scene, radian * most(y0 + found)))
        # The Jacobian takes a program of its own, and is rarely needed here.
        if (by_rate < _SHARE * at_start).any():
            found = coupled_sizes(scene, found)
    else:
        found = coupled_sizes(scene, found)
        slope, noise = _linear_terms(scene)
        noise = noise / np.maximum(np.diag(slope), 1 / radian)
        found = np.where(found > _RESOLVED * alike(scene, noise), found, 0.0)
    if (found > 0).all():
        return found
    if not found.any():
        return sizes_at_rest(scene, y0)
    return _fill_zeros(scene, found, _linear_terms(scene)[0], radian)


def sizes_at_rest(scene: Scene, y: np.ndarray) -> np.ndarray:
    """(k,) the size of each entry near an equilibrium y (k,), where the rate is rounding."""
    return np.array(at_rest(scene.field, groups(scene.system), y).sizes)


def coupled_sizes(scene: Scene, entry_sizes: np.ndarray) -> np.ndarray:
    """(k,) sizes, raised to the effect of the other entries over a characteristic time.

    Where units give the groups, they are raised to a small share of it.

    The time is 1 over the spectral radius of |J|, with J the rate's Jacobian at the start, and at
    most the span, since effects add up no longer than that; the limit matters where J is nilpotent,
    as at a Bogdanov-Takens point.
    """
    share = _SHARE if groups(scene.system).known else 1.0
    slope, _ = _linear_terms(scene)
    fastest = max(float(np.abs(np.linalg.eigvals(slope)).max()), 1 / float(scene.t1))
    for _ in range(len(entry_sizes)):
        effects = share * alike(scene, slope @ entry_sizes / fastest)
        larger = effects > (1 + _ROUNDING) * entry_sizes
        if not larger.any():
            break
        entry_sizes = np.where(larger, effects, entry_sizes)
    return entry_sizes


def sizes_along(scene: Scene, ys: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(k,) the sizes along a motion (s, k), from the known ones (k,) at its start."""
    found = np.maximum(known, alike(scene, np.abs(ys).max(axis=0)))
    return found if groups(scene.system).known else coupled_sizes(scene, found)


def alike(scene: Scene, numbers: np.ndarray) -> np.ndarray:
    """(k,) the largest number of each entry's group, from a non-negative number for each entry."""
    return groups(scene.system).sizes_on_host(numbers)


def largest_entry(vector: np.ndarray, entry_sizes: np.ndarray) -> int:
    """The entry of a vector (k,) that is largest in sizes (k,); of several, the first one."""
    size = np.abs(vector / entry_sizes)
    return int(np.argmax(size > (1 - _ALIKE) * size.max()))


def _fill_zeros(scene: Scene, found: np.ndarray, slope: np.ndarray, time: float) -> np.ndarray:
    """The sizes, with those that are 0 replaced by the effect of the others over a time.

    At least one size is not 0. An entry that no other one moves has the size at which the rate's
    Jacobian `slope` (k, k) changes by as much as itself, or by 1 over the time.
    """
    effects, y0, own = time * slope, np.asarray(scene.y0), functools.partial(alike, scene)
    return RateNear(scene.field, 0.0, y0, effects, own, 1 / time).fill_zeros(found)


def _linear_terms(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(k, k) |J| at the start, 0 where it is rounding, and (k,) the rounding error of the rate."""
    ys = shifted(np.asarray(scene.y0))
    rates, slopes = (np.asarray(x) for x in _rates_and_slopes(scene, jnp.asarray(ys)))
    noise, blur = (np.abs(x - x[0]).max(axis=0) for x in (rates, slopes))
    slope = np.abs(slopes[0])
    slope = np.where(np.isfinite(slope) & ~(blur > _ROUNDING * slope), slope, 0.0)
    return slope, np.where(np.isfinite(noise), noise, 0.0)


@jax.jit
def _rates_and_slopes(scene: Scene, ys: Array) -> tuple[Array, Array]:
    t = jnp.asarray(0.0)

    def near(y):
        return scene.rate(t, y), jax.jacfwd(scene.rate, argnums=1)(t, y)

    return jax.vmap(near)(ys)
