"""Whether a motion that repeats is stable: Floquet multipliers of driven scenes, and charts.

Near a motion that repeats after the period T, small differences x obey dx/dt = A(t) x with
A(t + T) = A(t), so x(T) = M x(0) with one matrix M, the monodromy matrix. Its eigenvalues are the
multipliers: differences grow where one lies outside of the unit circle. A driven scene at its
equilibrium (a pendulum upright on a shaking base) is such a motion, with the period of its drive.

Multipliers are computed numbers and carry an error bar: the change of M between two tolerances,
times the condition number of the eigenvectors. A real multiplier within its bar of the circle
decides nothing. A pair off the real line on the circle does, in a conservative scene: it can only
leave the circle by meeting another one.

Not for orbits of autonomous scenes, where multipliers are 1 by force and come in defective pairs.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._roots import root
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Scene

RTOL = 1e-12
_COARSER = 100.0  # the second tolerance, as a multiple of the first
_ROUNDING = 10 * np.finfo(float).eps  # relative to the largest entry of the matrix
_CONSERVED = 1e-9  # [1] |det(M) - 1| of a motion without damping, from integration errors
_CLOSED = 1e-6  # [1] gap of a motion that repeats, relative to its start


@dataclasses.dataclass(frozen=True)
class Floquet:
    """The multipliers of one motion, or of a grid of them; leading axes are the grid's.

    Attributes:
      multipliers: (..., k) complex, the largest first; NaN where the run failed.
      bars: (...) error bar of the multipliers.
      growth: (...) rate log(max |multiplier|) / T of the fastest difference [1/s].
      verdict: (...) "stable", "unstable" or "undecided". Stable are those all inside of the
        circle, and in a conservative scene those on it, off the real line and apart.
      monodromy: (..., k, k) the matrix M.
    """

    multipliers: np.ndarray
    bars: np.ndarray
    growth: np.ndarray
    verdict: np.ndarray
    monodromy: np.ndarray


@dataclasses.dataclass(frozen=True)
class Chart(Floquet):
    """Multipliers over a grid of two numbers: first (a,) along rows, second (b,) along columns."""

    first: np.ndarray
    second: np.ndarray


def monodromy(scene: Scene, period, *, rtol: float = RTOL) -> Array:
    """(k, k) derivative of the state after a period with respect to the start y0."""
    return _monodromy(scene, period, rtol)[0]


def _monodromy(scene: Scene, period, rtol) -> tuple[Array, Array]:
    def end(y):
        y1 = solve(scene.starting(y), period, rtol=rtol).y1
        return y1, y1

    return jax.jacfwd(end, has_aux=True)(scene.y0)


def multipliers(scene: Scene, period, *, rtol: float = RTOL) -> Floquet:
    """The Floquet multipliers of the motion of a scene from its start; host only.

    Args:
      scene: one whose start lies on a motion that repeats, e.g. its equilibrium under a drive.
      period: () of the drive [s].
      rtol: relative tolerance of a step.
    Raises:
      ValueError: a period that is not positive, or a motion that does not repeat.
    Example:
      >>> from jaxdyn.analysis import floquet
      >>> from jaxdyn import scenes
      >>> stick = scenes.shaken_pendulum(angle=0.0, amplitude=0.1, frequency=60.0)
      >>> str(floquet.multipliers(stick, 2 * 3.141592653589793 / 60.0).verdict)
      'stable'
    """
    scene.check()
    _checks.positive("period", period, "Of the drive, in seconds.")
    ways = _alone(scene, jnp.asarray(period, float), jnp.asarray(rtol))
    return _judged(*(np.asarray(x) for x in ways))


def chart(
    make: Callable[[Array, Array], tuple[Scene, Array]], first, second, *, rtol: float = RTOL
) -> Chart:
    """The multipliers over a grid of two numbers, in one compiled batch; host only.

    Args:
      make: (x, y) -> the scene at these numbers, started on its motion that repeats, and its
        period; a named function, or a module whose numbers may change without recompiling.
      first: (a,) values of x.
      second: (b,) values of y.
      rtol: relative tolerance of a step.
    Raises:
      ValueError: no numbers, or a motion that does not repeat.
    """
    first, second = (
        np.asarray(_checks.array(name, x, (None,)))
        for name, x in (("first", first), ("second", second))
    )
    if not len(first) or not len(second):
        raise _checks.fail("grid", "at least one number each way", f"{len(first)} x {len(second)}")
    corner, period = make(jnp.asarray(first[0]), jnp.asarray(second[0]))
    corner.check()
    _checks.positive("period", period, "Of the drive, in seconds.")
    xs, ys = (jnp.asarray(x.ravel()) for x in np.meshgrid(first, second, indexing="ij"))
    lanes = _grid(make, xs, ys, jnp.asarray(rtol))
    shape = len(first), len(second)
    found = _judged(*(np.asarray(x).reshape(*shape, *x.shape[1:]) for x in lanes))
    return Chart(*(getattr(found, f.name) for f in dataclasses.fields(Floquet)), first, second)


def edges(
    make: Callable[[Array, Array], tuple[Scene, Array]],
    between: tuple[float, float],
    second: float,
    *,
    looks: int = 200,
    rtol: float = RTOL,
) -> np.ndarray:
    """(n,) numbers x in order at which the motion of a scene becomes stable or unstable.

    Multipliers of a state of two entries cross the unit circle at +1 or -1, where 1 + det(M) is
    tr(M) or -tr(M), or, with damping, as a pair, where det(M) = 1. A grid shows where these
    conditions change sign; a bracketed secant method does the rest.

    Args:
      make: (x, y) -> scene and period; see `chart`.
      between: least and largest x.
      second: the value of y.
      looks: points of the grid.
      rtol: relative tolerance of a step.
    Raises:
      ValueError: a state of more than two entries, or fewer than two looks.
    Limits: two edges closer than the grid, or one that is only touched, are missed; host only.
    """
    xs = np.linspace(*(float(x) for x in between), _checks.whole("looks", looks))
    y = jnp.asarray(float(second))
    corner, _ = make(jnp.asarray(xs[0]), y)
    corner.check()
    k = len(corner.y0)
    if k != 2:
        raise _checks.fail("scene", "a state of 2 entries", k, "Use `chart` for larger ones.")

    def conditions(xs):
        return np.array([_conditions(make, x, y, rtol) for x in xs])

    values = conditions(xs)
    i, which = np.nonzero(values[:-1] * values[1:] < 0)

    def of_each(xs):
        return conditions(xs)[np.arange(len(xs)), which], np.full(len(xs), np.nan)

    found, _ = root(of_each, xs[i], xs[i + 1])
    return np.sort(found)


@eqx.filter_jit
def _conditions(make, x: Array, y: Array, rtol) -> Array:
    """(3,) what is zero where a multiplier crosses the unit circle."""
    M, _ = _monodromy(*make(x, y), rtol)
    trace, det = M[0, 0] + M[1, 1], M[0, 0] * M[1, 1] - M[0, 1] * M[1, 0]
    # Without damping det(M) is 1 but for rounding, which crosses nothing.
    damped = jnp.where(jnp.abs(det - 1) < _CONSERVED, 1.0, det)
    return jnp.stack([1 - trace + damped, 1 + trace + damped, damped - 1])


@eqx.filter_jit
def _grid(make, xs: Array, ys: Array, rtol) -> tuple[Array, ...]:
    return jax.vmap(lambda x, y: _both(*make(x, y), rtol))(xs, ys)


@eqx.filter_jit
def _alone(scene: Scene, period: Array, rtol) -> tuple[Array, ...]:
    return _both(scene, period, rtol)


def _both(scene: Scene, period: Array, rtol) -> tuple[Array, ...]:
    """The matrix at two tolerances, the period, and how far the motion is from closing."""
    M, end = _monodromy(scene, period, rtol)
    coarser, _ = _monodromy(scene, period, _COARSER * rtol)
    gap = jnp.max(jnp.abs(scene.system.difference(end, scene.y0)))
    return M, coarser, period, gap / (1.0 + jnp.max(jnp.abs(scene.y0)))


def _judged(M: np.ndarray, coarser: np.ndarray, period: np.ndarray, gap: np.ndarray) -> Floquet:
    if (gap > _CLOSED).any():
        raise _checks.fail(
            "y0",
            "a motion that is back after the period",
            f"one that misses its start by {np.nanmax(gap):.3g}",
            "Start at the equilibrium under the drive, and take the drive's period.",
        )
    failed = np.asarray(~np.isfinite(M).all(axis=(-2, -1)))
    safe = np.where(failed[..., None, None], 0.0, M)
    values, vectors = np.linalg.eig(safe)
    order = np.argsort(-np.abs(values), axis=-1, kind="stable")
    values = np.take_along_axis(values, order, axis=-1)
    bars = _bars(safe, np.where(failed[..., None, None], 0.0, coarser), vectors)
    verdict = np.where(failed, "undecided", _verdict(values, bars))
    values = np.where(failed[..., None], np.nan, values)
    growth = np.log(np.abs(values[..., 0])) / period
    return Floquet(values, np.where(failed, np.nan, bars), growth, verdict, M)


def _bars(M: np.ndarray, coarser: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """(...) how far an eigenvalue moves by the error of M: Bauer and Fike, at most Elsner.

    The second, (2 |M|)^(1 - 1/k) |E|^(1/k), holds where eigenvectors are parallel.
    """
    k = M.shape[-1]
    size = np.abs(M).max(axis=(-2, -1)) * k
    error = np.abs(M - coarser).max(axis=(-2, -1)) * k + _ROUNDING * size
    elsner = (2 * size) ** (1 - 1 / k) * error ** (1 / k)
    spread = np.linalg.svd(vectors, compute_uv=False)
    flat = spread[..., -1] == 0
    condition = spread[..., 0] / np.where(flat, 1.0, spread[..., -1])
    return np.where(flat, elsner, np.minimum(condition * error, elsner))


def _verdict(values: np.ndarray, bars: np.ndarray) -> np.ndarray:
    sizes, bar = np.abs(values), bars[..., None]
    apart = np.abs(values[..., :, None] - values[..., None, :])
    apart = np.where(np.eye(values.shape[-1], dtype=bool), np.inf, apart).min(axis=-1)
    on_circle = (np.abs(sizes - 1) <= bar) & (np.abs(values.imag) > bar) & (apart > 2 * bar)
    stable = ((sizes < 1 - bar) | on_circle).all(axis=-1)
    unstable = (sizes > 1 + bar).any(axis=-1)
    return np.where(unstable, "unstable", np.where(stable, "stable", "undecided"))
