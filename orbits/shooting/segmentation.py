"""The segments of multiple shooting: their number, and where a motion is cut."""

import dataclasses
import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail, whole
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.analysis.regularized import logarithmic_span
from orbits.closing.sizes import sizes
from orbits.motion import at_even_s, attracts, quick_solve
from orbits.shooting.equations import Equations, pieces, sizes_at
from orbits.shooting.segment import UNTIMED, Limits

#: Largest growth of errors of the start over a motion that is one segment: rounding of 1e-16 then
#: stays well below the goal.
_GROWTH_MOST = 300.0
#: Largest growth, up to the end of a segment, of errors made anywhere in it.
_GROWTH_INSIDE_MOST = 3000.0
#: Most segments that are chosen automatically.
SEGMENTS_MOST = 32
#: Most segments that a caller may ask for; the equations for the unknowns of all of them form one
#: matrix.
_SEGMENTS_GIVEN_MOST = 256
_NUMBERS = (1, 2, 4, 8, 16, SEGMENTS_MOST)  # numbers of segments that are tried, few to compile
#: Other segments are worthwhile if they leave at most this share of the growth of errors.
_WORTHWHILE = 0.5
_SAME_CUTS = 0.1  # segments whose lengths differ by less, relatively, count as the same
_SAMPLES = 4096  # samples of a motion, to measure its rate of change
_SAMPLES_OF_SEVERAL = 512  # samples of each segment, if the motion has several
_CUT_RTOL = 1e-10  # tolerance of the times at which segments begin


def cut_into_segments(
    equations: Equations,
    guess,
    rtol,
    segments: int | None,
    angle=0.0,
    parameter=0.0,
    least=1,
    limits: Limits = UNTIMED,
):
    """The equations in a number of segments.

    With `segments=None` there are as many as the growth of errors requires, and at least `least`;
    if the time is up before that is known, one.
    """
    if equations.collocated:
        if segments is not None:
            raise fail("segments", "none for an orbit by collocation", segments)
        return equations
    x = equations.spread(guess[:-1], guess[-1], rtol, angle, parameter)
    if segments is None:
        found = map_in_units(equations(x, rtol, limits).transitions, sizes_at(equations, x))
        growth = float(np.linalg.norm(found[0]))
        # NaN means a collision, or encounters that take too many steps in plain time.
        if growth <= _GROWTH_MOST or not (math.isfinite(growth) or attracts(equations.scene)):
            segments = least
        else:
            few = least if math.isfinite(growth) else max(least, _NUMBERS[1])
            segments = max(few, segments_needed(equations, x, rtol, limits))
        if limits.over():
            return equations
    if whole("segments", segments, most=_SEGMENTS_GIVEN_MOST) == 1:
        return equations
    return with_segments(equations, x, rtol, segments)


def recut(
    equations: Equations, x: np.ndarray, rtol, entry_sizes: np.ndarray, growth: float
) -> Equations | None:
    """The equations in segments over which errors grow less than over the present ones at x (n,).

    There are at least as many segments, which are shorter where the motion at x changes faster.
    None where new segments gain nothing.

    Args:
      equations: the equations.
      x: (n,) unknowns.
      rtol: tolerance of the integrations.
      entry_sizes: (k,) the sizes of the state's entries, in which errors are measured.
      growth: largest growth of errors over a segment at x.
    """
    if equations.collocated or not growth > _GROWTH_MOST:
        return None
    maps = _fine_maps(equations, x, rtol, entry_sizes)
    grown = {n: _growth(maps, n) for n in _NUMBERS if n >= equations.segments}
    better = (n for n in grown if grown[n] <= max(_GROWTH_MOST, _WORTHWHILE * growth))
    segments = next(better, None)
    if segments is None:
        return None
    new = with_segments(equations, x, rtol, segments)
    same = segments == equations.segments and np.allclose(
        new.shares, equations.shares, rtol=_SAME_CUTS
    )
    return None if same else new


def segments_needed(equations: Equations, x: np.ndarray, rtol, limits: Limits) -> int:
    """Number of segments for which rounding anywhere in a segment grows little up to its end.

    If the time is up before that is known, it is the largest number.
    """
    maps = _fine_maps(equations, x, rtol, sizes_at(equations, x), limits)
    fits = (n for n in _NUMBERS if _growth(maps, n) <= _GROWTH_INSIDE_MOST)
    return next(fits, SEGMENTS_MOST)


def _fine_maps(
    equations: Equations, x: np.ndarray, rtol, entry_sizes: np.ndarray, limits: Limits = UNTIMED
) -> np.ndarray:
    """(n, k, k) derivatives of the ends of `SEGMENTS_MOST` segments by their starts, in sizes."""
    fine = with_segments(equations, x, rtol, SEGMENTS_MOST)
    found = fine(equations.move_to(x, fine, rtol), rtol, limits).transitions
    return map_in_units(np.asarray(found), entry_sizes)


def _growth(maps: np.ndarray, segments: int) -> float:
    """Largest growth, up to the end of a segment, of errors made anywhere in it."""
    return max(largest(part) for part in np.split(maps, segments))


def largest(maps: Sequence[np.ndarray] | np.ndarray) -> float:
    """Largest norm of the last end's derivative with respect to any start, from maps (n, k, k)."""
    total, largest = np.eye(len(maps[-1])), 0.0
    for one in maps[::-1]:
        total = total @ one
        largest = max(largest, float(np.linalg.norm(total)))
    return largest


def with_segments(equations: Equations, x: np.ndarray, rtol, segments: int) -> Equations:
    """The equations in a number of segments, which are shorter where the motion changes faster.

    The motion is that at x (n,). Where bodies attract each other, segments are about equal in
    logarithmic time; elsewhere the fastest rate of change has about the same integral over each.
    """
    unknowns = equations.unpack(x)
    part = float(unknowns.period) / equations.closing.parts
    scene = equations.scene_at(unknowns.parameter).starting(equations.start_at(x), part)
    ts, ys = _sample(equations, x, rtol)
    if attracts(scene, ts, ys):
        s = float(logarithmic_span(scene, part))
        if np.isfinite(s):
            return _between_encounters(equations, scene, s, segments)
    fastest = np.asarray(_fastest(scene, ts, ys, sizes(scene))) + 1 / part
    if not np.isfinite(fastest).all():
        return dataclasses.replace(equations, shares=(1 / segments,) * segments, s_spans=None)
    ends = divide(ts, 0.5 * (fastest[1:] + fastest[:-1]) * np.diff(ts), segments)
    shares = tuple((np.diff(ends) / part).tolist())
    return dataclasses.replace(equations, shares=shares, s_spans=None)


def divide(ts: np.ndarray, weights: np.ndarray, number: int) -> np.ndarray:
    """(number + 1,) times that divide the range of ts (n + 1,) into parts of equal weight.

    The weights (n,) > 0 are those of the intervals between the ts.
    """
    grown = np.append(0.0, np.cumsum(weights))
    return np.interp(np.linspace(0.0, grown[-1], number + 1), grown, ts)


def _sample(equations: Equations, x: np.ndarray, rtol) -> tuple[np.ndarray, np.ndarray]:
    """(s,) times and (s, k) states of the motion at x, with each segment from its own start."""
    here = jax.tree.map(np.asarray, pieces(equations, x))
    scene = equations.scene_at(equations.unpack(x).parameter)
    samples = _SAMPLES if equations.segments == 1 else _SAMPLES_OF_SEVERAL
    ends = np.cumsum(here.span)
    times, states = [], []
    for start, t0, span, end in zip(here.start, here.t0, here.span, ends, strict=True):
        ts = np.linspace(t0, t0 + span, samples)
        states.append(quick_solve(scene.starting(start), ts[-1], t0=t0, ts=ts, rtol=rtol).ys)
        times.append(np.linspace(end - span, end, samples))
    return np.concatenate(times), np.concatenate(states)


def _between_encounters(equations: Equations, scene: Scene, s: float, segments: int) -> Equations:
    """About equal segments in logarithmic time, with cuts where bodies are far apart.

    In an encounter velocities are large and ill-conditioned, so that joining segments there would
    lose digits.
    """
    ts, depth = (np.asarray(z) for z in at_even_s(scene, s, _CUT_RTOL, samples=_SAMPLES))
    middles = np.arange(1, segments) * _SAMPLES / segments
    half = 0.5 * _SAMPLES / segments
    windows = [np.arange(math.ceil(m - half), math.ceil(m + half)) for m in middles]
    cuts = [0, *(window[np.argmin(depth[window])] for window in windows), _SAMPLES]
    shares = tuple((np.diff(ts[cuts]) / ts[-1]).tolist())
    spans = tuple((np.diff(cuts) * (s / _SAMPLES)).tolist())
    return dataclasses.replace(equations, shares=shares, s_spans=spans)


@jax.jit
def _fastest(scene: Scene, ts: Array, ys: Array, entry_sizes: Array) -> Array:
    """(s,) rates of change along a motion, about the largest eigenvalue of the rate's Jacobian.

    The estimate is the fourth root of the norm of the Jacobian's fourth power, in units of the
    sizes (k,) of the entries, which is much cheaper than eigenvalues.
    """
    slopes = jax.vmap(jax.jacfwd(scene.rate, argnums=1))(ts, ys)
    slopes = slopes * (entry_sizes[None] / entry_sizes[:, None])[None]
    fourth = jnp.linalg.matrix_power(slopes, 4)
    return jnp.sqrt(jnp.sqrt(jnp.linalg.norm(fourth, axis=(1, 2))))
