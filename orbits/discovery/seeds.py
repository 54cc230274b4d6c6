"""Guesses of periodic orbits, without knowing one.

Small oscillations about equilibria, close returns of one long run, starts fixed by a time
reversal, and rows of published tables. Each is a start and a period for `find`, or starts for
`search`.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import array, check_first, fail, positive
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.analysis.linearize import check_equilibrium, linearize
from jaxdyn.analysis.scales_at_rest import at_rest
from jaxdyn.scales import groups
from jaxdyn.scenes import three_body
from orbits.closing.closings import PLAIN, Closing, Symmetry
from orbits.closing.sizes import largest_entry, sizes_along
from orbits.discovery.screening import ClosingGap, sizes_of_starts
from orbits.motion import quick_solve

_SAMPLES = 2048  # of the run
#: Entries of an eigenvector below this share of its largest are rounding.
_ENTRY = 64 * np.finfo(float).eps
#: Shares of its size: an entry that moves less is at rest to rounding, one that moves more escapes.
_STILL, _AWAY = 1e-8, 10.0


@dataclasses.dataclass(frozen=True)
class Seed:
    """A guess for `find`: ``orbits.find(scene, seed.y0, seed.period)``.

    Attributes:
      y0: (k,) start.
      period: full period.
    """

    y0: np.ndarray
    period: float


@check_first
def modes(scene: Scene, y, amplitude: float) -> list[Seed]:
    """Small oscillations about an equilibrium, one seed for each that neither grows nor decays.

    By Lyapunov's centre theorem a conservative scene has a family of periodic orbits that
    starts from each of them, unless another frequency is a multiple of its own.

    Args:
      scene: a conservative scene.
      y: (k,) an equilibrium, e.g. of `jaxdyn.equilibria`.
      amplitude: displacement, in its unit, of the entry that is displaced most relative to its
        size; of several such entries the first, as of an angle and its velocity.
    Returns:
      The seeds, the slowest first.
    Raises:
      ValueError: y is not an equilibrium.
    Example:
      >>> from jaxdyn import scenes
      >>> from orbits.discovery import seeds
      >>> [round(seed.period, 6) for seed in seeds.modes(scenes.oscillator(k=1.0), [0, 0], 0.1)]
      [6.283185]
    """
    y = np.asarray(array("y", y, (len(scene.y0),)))
    positive("amplitude", amplitude)
    linear = linearize(scene, y)
    check_equilibrium(scene, jnp.asarray(y))
    each = np.asarray(at_rest(scene.field, groups(scene.system), y).sizes)
    values, vectors = np.linalg.eig(map_in_units(linear.jacobian, each))
    bar = linear.bars.max()
    turning = [i for i in range(len(values)) if values[i].imag > bar >= abs(values[i].real)]
    seeds = []
    for i in sorted(turning, key=lambda i: values[i].imag):
        most = largest_entry(each * vectors[:, i], each)
        shape = (vectors[:, i] / vectors[most, i]).real
        # Smaller entries are rounding; a start of 1e-21 would count as a motion of that size.
        shape = each / each[most] * np.where(np.abs(shape) > _ENTRY, shape, 0.0)
        seeds.append(Seed(y + amplitude * shape, float(2 * np.pi / values[i].imag)))
    return seeds


@check_first
def returns(
    scene: Scene,
    span: float,
    *,
    longest: float,
    closing: Closing = PLAIN,
    shortest: float = 0.0,
    most: int = 10,
) -> list[Seed]:
    """The closest returns of one long run to its earlier states, the closest first.

    A chaotic motion follows one unstable periodic orbit after another for a while; where it
    nearly closes, one is near.

    Args:
      scene: the scene; its own start is that of the run.
      span: duration of the run.
      longest: longest period.
      closing: the closing condition, without an unknown turn.
      shortest: shortest period.
      most: largest number of seeds.
    Returns:
      Seeds at local minima, over sampled starts and periods, of the residual. Its entries are
      measured by how far they, or others of their unit, move in the run.
    Raises:
      ValueError: not 0 <= `shortest` < `longest` <= `span`, or `span` is so long that its 2048
        samples do not resolve a return.
    """
    _check_periods(span, shortest, longest)
    count = _SAMPLES
    ts = np.linspace(0.0, span, count)
    flow = quick_solve(scene, span, ts=ts, rtol=1e-10)
    low = max(1, int(np.ceil(shortest / closing.parts / ts[1])))
    high = min(count - 1, int(longest / closing.parts / ts[1]))
    if high <= low + 1:
        least = (low + 2) * ts[1] * closing.parts
        remedy = f"The run has {count} samples, one every {ts[1]:.3g}. Choose a shorter span."
        raise fail("longest", f"at least {least:.3g}", longest, remedy)
    units = jnp.asarray(closing.residual_units(_return_sizes(scene, span, np.asarray(flow.ys))))
    misses = np.asarray(_miss_table(ClosingGap(scene.system, closing, units), flow.ys, low, high))
    around = np.pad(misses, 1, constant_values=np.inf)
    rows, columns = misses.shape
    shifts = [(i, j) for i in (0, 1, 2) for j in (0, 1, 2) if (i, j) != (1, 1)]
    with np.errstate(invalid="ignore"):
        least = np.all([misses <= around[i : i + rows, j : j + columns] for i, j in shifts], axis=0)
    least &= np.isfinite(misses)
    least[:, 0] = False  # leaving the start is not a return
    found = sorted(zip(*np.nonzero(least), strict=True), key=lambda ij: misses[ij])[:most]
    ys = np.asarray(flow.ys)
    return [Seed(ys[i], float(ts[low + j] * closing.parts)) for i, j in found]


def _return_sizes(scene: Scene, span: float, ys: np.ndarray) -> np.ndarray:
    """(k,) the sizes in which returns of a motion, samples (s, k), are measured.

    They follow from its extent. The magnitudes of its entries would depend on the origin: relative
    to a barycentre that is far away, all motions around a libration point nearly close.
    """
    each = extents(scene, span, ys)
    return sizes_along(scene, each[None], np.zeros_like(each))


def extents(scene: Scene, span: float, ys: np.ndarray) -> np.ndarray:
    """(k,) how far each entry moves in samples (s, k) of a motion.

    They are bounded from both sides, since neither a motion that escapes nor one at rest to
    rounding shows how far those that close move.
    """
    each = sizes_of_starts(scene, scene.y0[None], span)
    known = ys[np.isfinite(ys).all(axis=1)]
    return np.clip(np.ptp(known, axis=0), _STILL * each, _AWAY * each)


@eqx.filter_jit
def _miss_table(gap: ClosingGap, ys: Array, low: int, high: int) -> Array:
    """(s, high - low) norms of the residual with which sample i + low + j closes on sample i."""
    count = len(ys)

    def row(i):
        later = i + low + jnp.arange(high - low)
        missed = jax.vmap(lambda y: gap(y, ys[i]))(ys[jnp.minimum(later, count - 1)])
        return jnp.where(later < count, jnp.linalg.norm(missed, axis=-1), jnp.inf)

    return jax.lax.map(row, jnp.arange(count))


def line(reversal: Symmetry, low, high, shape) -> np.ndarray:
    """(n, k) a grid of starts fixed by a time reversal: for closing by `reversal`.

    Args:
      reversal: the time reversal.
      low: (k,) lower corner; entries that follow from others are overwritten.
      high: (k,) upper corner.
      shape: (k,) points along each entry; 1 takes the middle.
    Example:
      >>> import orbits
      >>> orbits.discovery.seeds.line(orbits.time_reversal(2), [0.1, 0], [0.3, 0], [3, 1]).tolist()
      [[0.1, 0.0], [0.2, 0.0], [0.3, 0.0]]
    """
    low, high = (np.asarray(array(name, x, (None,))) for name, x in (("low", low), ("high", high)))
    if not len(low) == len(high) == len(shape):
        raise fail("shape", f"{len(low)} entries, like low and high", f"{len(shape)}")
    axes = [
        np.linspace(a, b, n) if n > 1 else np.array([0.5 * (a + b)])
        for a, b, n in zip(low, high, shape, strict=True)
    ]
    grid = np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=1)
    kept = 0.5 * (grid + np.stack([np.asarray(reversal.act(jnp.asarray(y))) for y in grid]))
    return np.unique(kept + 0.0, axis=0)


def row(a: float, b: float, period: float) -> tuple[Scene, Seed]:
    """A row of the tables of three equal bodies in line, without momentum and angular momentum.

    Positions (-1, 0), (1, 0), (0, 0); velocities (a, b), (a, b), (-2a, -2b); G = m = 1.

    Returns:
      The scene, which starts there, and the seed.
    Reference: Suvakov, Dmitrasinovic (2013), Physical Review Letters 110, 114301.
    Example:
      >>> import orbits
      >>> scene, seed = orbits.discovery.seeds.row(0.34711, 0.53273, 6.3259)      # the figure-eight
      >>> round(orbits.find(scene, seed.y0, seed.period).period, 4)
      6.3259
    """
    y0 = rows(np.array([[a, b]], float))[0]
    return three_body(y0, t1=float(period)), Seed(y0, float(period))


def rows(ab: np.ndarray) -> np.ndarray:
    """(n, 12) the starts of `row` for many velocities (n, 2)."""
    ab = np.asarray(ab, float)
    r = np.broadcast_to(np.array([-1.0, 0.0, 1.0, 0.0, 0.0, 0.0]), (len(ab), 6))
    return np.concatenate([r, ab, ab, -2 * ab], axis=1)


def _check_periods(span, shortest, longest) -> None:
    positive("span", span)
    if not 0 <= shortest < longest <= span:
        raise fail("longest", f"above shortest = {shortest}, at most span = {span}", longest)
