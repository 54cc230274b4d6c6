"""The segments of multiple shooting: their number, and where a motion is cut."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail, whole
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.analysis.regularised import logarithmic_span
from orbits.closing.sizes import sizes
from orbits.motion import at_even_s, attracts, solved
from orbits.shooting.equations import Equations
from orbits.shooting.units import sizes_at

#: Largest growth of errors of the start over a motion in one segment: rounding of 1e-16 is still
#: well below the goal then.
_GROWTH_MOST = 300.0
#: Largest growth of errors, made anywhere in a segment, to its end.
_GROWTH_INSIDE_MOST = 3000.0
#: Most segments that are chosen automatically.
SEGMENTS_MOST = 32
#: Most segments that a caller may ask for: the unknowns of all of them are one matrix.
_SEGMENTS_GIVEN_MOST = 256
_SAMPLES = 4096  # of a motion, to measure its rate of change
_CUT_RTOL = 1e-10  # tolerance of the times at which segments begin


def cut(equations: Equations, guess, rtol, segments: int | None, angle=0.0, parameter=0.0, least=1):
    """The equations in a number of segments; None for as many as the growth of errors requires.

    These are at least `least`.
    """
    if equations.collocated:
        if segments is not None:
            raise fail("segments", "none for an orbit by collocation", segments)
        return equations
    if segments is None:
        x = equations.spread(guess[:-1], guess[-1], rtol, angle, parameter)
        found = map_in_units(equations(x, rtol).transitions, sizes_at(equations, x))
        growth = float(np.linalg.norm(found[0]))
        # NaN: a collision, or encounters that take too many steps in plain time.
        if growth <= _GROWTH_MOST or not (math.isfinite(growth) or attracts(equations.scene)):
            segments = least
        else:
            segments = max(least, needed(equations, guess, rtol, parameter))
    if whole("segments", segments, most=_SEGMENTS_GIVEN_MOST) == 1:
        return equations
    return with_segments(equations, guess, rtol, segments, parameter)


def needed(equations: Equations, guess, rtol, parameter=0.0) -> int:
    """Number of segments in which rounding anywhere in one grows little to its end."""
    fine = with_segments(equations, guess, rtol, SEGMENTS_MOST, parameter)
    scene = equations.scene_at(jnp.asarray(parameter, float)).starting(guess[:-1], guess[-1])
    maps = fine.transitions(guess[:-1], guess[-1], rtol, parameter)
    maps = map_in_units(maps, sizes(scene))
    # Powers of two: each number of segments is compiled once.
    for segments in (1, 2, 4, 8, 16):
        grown = [largest(part) for part in np.split(maps, segments)]
        if np.max(grown) <= _GROWTH_INSIDE_MOST:
            return segments
    return SEGMENTS_MOST


def largest(maps: np.ndarray) -> float:
    """Largest norm of the derivatives of the end by the start of consecutive pieces (n, k, k)."""
    total, largest = np.eye(maps.shape[-1]), 0.0
    for one in maps[::-1]:
        total = total @ one
        largest = max(largest, float(np.linalg.norm(total)))
    return largest


def with_segments(equations: Equations, guess, rtol, segments: int, parameter=0.0) -> Equations:
    """The equations in a number of segments, which are shorter where the motion changes faster.

    They are about equal in logarithmic time where bodies attract each other; elsewhere the fastest
    rate of change has about the same integral over each.
    """
    part = guess[-1] / equations.closing.parts
    ts = np.linspace(0.0, part, _SAMPLES)
    scene = equations.scene_at(jnp.asarray(parameter, float)).starting(guess[:-1], part)
    ys = solved(scene, part, ts=ts, rtol=rtol).ys
    if attracts(scene, ts, ys):
        s = float(logarithmic_span(scene, part))
        if np.isfinite(s):
            return _between_encounters(equations, scene, s, segments)
    fastest = np.asarray(_fastest(scene, ts, ys, sizes(scene))) + 1 / part
    if not np.isfinite(fastest).all():
        return dataclasses.replace(equations, shares=(1 / segments,) * segments, s_spans=None)
    grown = np.append(0.0, np.cumsum(0.5 * (fastest[1:] + fastest[:-1])))
    ends = np.interp(np.linspace(0.0, grown[-1], segments + 1), grown, ts)
    shares = tuple((np.diff(ends) / part).tolist())
    return dataclasses.replace(equations, shares=shares, s_spans=None)


def _between_encounters(equations: Equations, scene: Scene, s: float, segments: int) -> Equations:
    """About equal segments in logarithmic time, with cuts where bodies are far apart.

    In an encounter velocities are large and ill-conditioned, so that the joints of a cut there
    would lose digits.
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
def _fastest(scene: Scene, ts: Array, ys: Array, each: Array) -> Array:
    """(s,) rates of change along a motion, about the largest eigenvalue of the rate's Jacobian.

    From the norm of its fourth power, in units of the sizes (k,) of the entries, which is much
    cheaper than eigenvalues.
    """
    slopes = jax.vmap(jax.jacfwd(scene.rate, argnums=1))(ts, ys)
    slopes = slopes * (each[None] / each[:, None])[None]
    fourth = jnp.linalg.matrix_power(slopes, 4)
    return jnp.sqrt(jnp.sqrt(jnp.linalg.norm(fourth, axis=(1, 2))))
