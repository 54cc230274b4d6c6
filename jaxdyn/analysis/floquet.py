"""Stability of periodic motions: Floquet multipliers of driven scenes, and stability charts.

Near a motion of period T, small perturbations x obey dx/dt = A(t) x with A(t + T) = A(t), so
x(T) = M x(0) with the monodromy matrix M. Its eigenvalues are the multipliers: perturbations grow
if one lies outside the unit circle. A driven scene at its equilibrium (a pendulum upright on a
shaking base) is such a motion, with the period of its drive.

Multipliers are computed numbers and carry an error bar (see `eigenvalues`), from the change of M
between two tolerances. A real multiplier within its bar of the circle decides nothing. A complex
pair on the circle does, in a conservative scene: it can leave the circle only by meeting another
pair. Conservative means that M preserves a symplectic form: that of the scene's canonical
coordinates or, where it has none, a constant one that its rate preserves (`invariant_form`).

This is not for orbits of autonomous scenes, which always have multipliers 1, in defective pairs.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.analysis._roots import root
from jaxdyn.analysis.eigenvalues import balance, map_eigenvalues, map_in_units, map_verdict
from jaxdyn.analysis.monodromy import (
    RTOL,
    SYMPLECTIC,
    coarser,
    end_and_derivative,
    preserved_form,
    slopes_nearby,
    symplectic_defect,
    symplectic_form,
    uncertainty,
)
from jaxdyn.integrate.spans import tolerances
from jaxdyn.scales import at_start, groups
from jaxdyn.scene import Scene, check_scene

#: Largest |det(M) - 1| [1] of a motion without damping, from integration errors.
_MAX_DETERMINANT_ERROR = 1e-9
_MAX_GAP = 1e-6  # [1] closing error of a periodic motion, relative to its start


@dataclasses.dataclass(frozen=True)
class Floquet:
    """The multipliers of one motion, or of a grid of them; leading axes are the grid's.

    Attributes:
      multipliers: (..., k) complex, largest first; NaN where the run failed.
      bars: (..., k) error bar of each.
      growth: (...) rate log(max |multiplier|) / T of the fastest-growing perturbation [1/s].
      verdict: (...) "stable", "unstable" or "undecided". Stable means all inside the circle, or,
        in a conservative scene, on it, not real and distinct.
      monodromy: (..., k, k) the matrix M.
    """

    multipliers: np.ndarray
    bars: np.ndarray
    growth: np.ndarray
    verdict: np.ndarray
    monodromy: np.ndarray

    __repr__ = _text.fields
    _repr_html_ = _text.html


@dataclasses.dataclass(frozen=True, repr=False)
class Chart(Floquet):
    """Multipliers over a grid of two parameters: first (a,) by row, second (b,) by column."""

    first: np.ndarray
    second: np.ndarray


@check_first
def multipliers(scene: Scene, period, *, rtol: float = RTOL) -> Floquet:
    """The Floquet multipliers of the motion of a scene from its start; host only.

    Args:
      scene: one whose start lies on a periodic motion, e.g. its equilibrium under a drive.
      period: () period of the drive [s].
      rtol: relative tolerance of a step.
    Raises:
      ValueError: `period` is not positive, `rtol` is out of range, or the motion does not repeat.
    Example:
      >>> from jaxdyn.analysis import floquet
      >>> from jaxdyn import scenes
      >>> stick = scenes.shaken_pendulum(angle=0.0, amplitude=0.1, frequency=60.0)
      >>> str(floquet.multipliers(stick, 2 * 3.141592653589793 / 60.0).verdict)
      'stable'
    """
    check_scene(scene)
    _checks.positive("period", period, "It is that of the drive, in seconds.")
    found = _one_period(scene, jnp.asarray(period, float), _tolerances(rtol))
    return _judge(jax.tree.map(np.asarray, found), rtol)


def chart(
    make: Callable[[Array, Array], tuple[Scene, Array]], first, second, *, rtol: float = RTOL
) -> Chart:
    """The multipliers over a grid of two parameters, in one compiled batch; host only.

    Args:
      make: (x, y) -> the scene at these values, started on its periodic motion, and its period;
        a named function, or a module whose numbers may change without recompiling.
      first: (a,) values of x.
      second: (b,) values of y.
      rtol: relative tolerance of a step.
    Raises:
      ValueError: no numbers, `rtol` out of range, or a motion that does not repeat.
    Limits: damping that vanishes only on average over the period leaves stable motions undecided.
    """
    first, second, xs, ys = _checks.grid(first, second)
    corner, period = make(jnp.asarray(first[0]), jnp.asarray(second[0]))
    check_scene(corner)
    _checks.positive("period", period, "It is that of the drive, in seconds.")
    shape = len(first), len(second)
    lanes = jax.tree.map(
        lambda x: np.asarray(x).reshape(*shape, *x.shape[1:]),
        _grid(make, xs, ys, _tolerances(rtol)),
    )
    found = {f.name: getattr(_judge(lanes, rtol), f.name) for f in dataclasses.fields(Floquet)}
    return Chart(**found, first=first, second=second)


def edges(
    make: Callable[[Array, Array], tuple[Scene, Array]],
    between: tuple[float, float],
    second: float,
    *,
    looks: int = 200,
    rtol: float = RTOL,
) -> np.ndarray:
    """(n,) values of x, ascending, at which the motion of a scene becomes stable or unstable.

    Multipliers of a state of two entries cross the unit circle at +1 or -1, where 1 + det(M) is
    tr(M) or -tr(M), or, with damping, as a pair, where det(M) = 1. A grid shows where these
    conditions change sign; a bracketed secant method refines them.

    Args:
      make: (x, y) -> scene and period; see `chart`.
      between: smallest and largest x.
      second: the value of y.
      looks: number of grid points.
      rtol: relative tolerance of a step.
    Raises:
      ValueError: a state of more than two entries, `looks` below 2, or `rtol` out of range.
    Limits: host only; two edges between the same grid points, or a condition that touches 0
      without a change of sign, are missed.
    """
    low, high = between
    xs = np.linspace(float(low), float(high), _checks.whole("looks", looks))
    y = jnp.asarray(float(second))
    corner, _ = make(jnp.asarray(xs[0]), y)
    check_scene(corner)
    tolerances(rtol, None)
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
    """(3,) functions that vanish where a multiplier crosses the unit circle."""
    _, M = end_and_derivative(*make(x, y), rtol)
    trace, det = M[0, 0] + M[1, 1], M[0, 0] * M[1, 1] - M[0, 1] * M[1, 0]
    # Without damping det(M) is 1 up to rounding, which is not a crossing.
    damped = jnp.where(jnp.abs(det - 1) < _MAX_DETERMINANT_ERROR, 1.0, det)
    return jnp.stack([1 - trace + damped, 1 + trace + damped, damped - 1])


class _Period(NamedTuple):
    """The linear map of one period.

    Attributes:
      monodromy: (k, k) the matrix M.
      coarse: (k, k) M at a coarser tolerance.
      period: () the period [s].
      gap: () closing error of the motion, relative to the sizes of the entries at its start and
        to their images under M.
      form: (k, k) symplectic form that M preserves if the scene is conservative, or None.
      slopes: (n, k, k) Jacobians of the rate that determine such a form if `form` is None, or None.
    """

    monodromy: Array
    coarse: Array
    period: Array
    gap: Array
    form: Array | None
    slopes: Array | None


def _tolerances(rtol: float) -> tuple[Array, Array]:
    tolerances(rtol, None)  # checked here, since it cannot be inside jit
    return jnp.asarray(rtol), jnp.asarray(coarser(rtol))


@eqx.filter_jit
def _grid(make, xs: Array, ys: Array, rtols) -> _Period:
    def passed(x, y):
        scene, period = make(x, y)
        return _one_period(scene, period, rtols)

    return jax.vmap(passed)(xs, ys)


@eqx.filter_jit
def _one_period(scene: Scene, period: Array, rtols) -> _Period:
    (end, M), (_, coarse) = (end_and_derivative(scene, period, rtol) for rtol in rtols)
    known = groups(scene.system)
    sizes = at_start(scene.field, known, jnp.zeros(()), scene.y0, period)[0].sizes
    sizes = jnp.maximum(sizes, known.sizes(jnp.abs(M) @ sizes))
    gap = jnp.abs(scene.system.difference(end, scene.y0))
    form = symplectic_form(scene, scene.y0)
    each = jnp.where(sizes > 0, sizes, 1.0)
    return _Period(
        monodromy=M,
        coarse=coarse,
        period=period,
        gap=jnp.max(gap / jnp.where(gap > 0, sizes, 1.0)),
        form=form,
        slopes=slopes_nearby(scene, each, period) if form is None else None,
    )


def _judge(found: _Period, rtol: float) -> Floquet:
    M, coarse, period, gap, form, slopes = found
    if (gap > _MAX_GAP).any():
        raise _checks.fail(
            "y0",
            "a motion that repeats after the period",
            f"one that misses its start by {np.nanmax(gap):.3g}",
            "Start at the equilibrium under the drive, and pass the drive's period.",
        )
    failed = np.asarray(~(np.isfinite(M) & np.isfinite(coarse)).all(axis=(-2, -1)))
    safe, coarse = (np.where(failed[..., None, None], 0.0, x) for x in (M, coarse))
    units = balance(safe)
    safe, coarse = (map_in_units(x, units) for x in (safe, coarse))
    if form is None and slopes is not None:
        form = _preserved_forms(slopes)
    if form is not None:
        form = form * units[..., None, :] * units[..., :, None]
    eigenvalues = map_eigenvalues(safe, uncertainty(safe, coarse, rtol))
    conservative = False if form is None else symplectic_defect(safe, form) < SYMPLECTIC
    verdict = np.where(failed, "undecided", map_verdict(eigenvalues, conservative))
    values, bars = (np.where(failed[..., None], np.nan, x) for x in eigenvalues)
    growth = np.log(np.abs(values[..., 0])) / period
    return Floquet(multipliers=values, bars=bars, growth=growth, verdict=verdict, monodromy=M)


def _preserved_forms(slopes: np.ndarray) -> np.ndarray:
    """(..., k, k) the `preserved_form` of slopes (..., n, k, k), NaN where there is none."""
    k = slopes.shape[-1]
    found = (preserved_form(x) for x in slopes.reshape(-1, *slopes.shape[-3:]))
    forms = [np.full((k, k), np.nan) if x is None else x for x in found]
    return np.reshape(forms, (*slopes.shape[:-3], k, k))
