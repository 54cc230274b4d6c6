"""Into how many segments a motion is cut for multiple shooting, and where."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import whole
from jaxdyn.analysis.regularised import logarithmic_span
from jaxdyn.integrate.simulation import solve
from orbits.motion import at_even_s, attracts
from orbits.shooting.equations import Equations

#: Growth of errors over a segment from which on more segments are taken: rounding of 1e-16,
#: grown so much, is well below the goal.
_GROWTH = 300.0
#: The same where rounding of each moment on the way is followed, not that of the start alone.
_GROWTH_INSIDE = 3000.0
SEGMENTS_MOST = 32
_SEGMENTS_GIVEN = 256  # all of them are one matrix
_SAMPLES = 4096  # of a motion, to see how fast it changes where
_EVEN_RTOL = 1e-10  # of the times at which segments begin


def cut(equations: Equations, guess, rtol, segments: int | None, angle=0.0, parameter=0.0):
    """The equations with so many segments, or as many as the guess's growth calls for."""
    if segments is None:
        x = equations.spread(guess[:-1], guess[-1], rtol, angle, parameter)
        growth = float(np.linalg.norm(np.asarray(equations(x, rtol).transitions)[0]))
        # Not a number: a collision, or encounters that take too many steps of plain time.
        if growth <= _GROWTH or not (math.isfinite(growth) or attracts(equations.scene)):
            return equations
        segments = needed(equations, guess, rtol, parameter)
    elif whole("segments", segments, most=_SEGMENTS_GIVEN) == 1:
        return equations
    return with_segments(equations, guess, rtol, segments, parameter)


def needed(equations: Equations, guess, rtol, parameter=0.0) -> int:
    """So many segments that rounding made anywhere in one grows little to its end."""
    fine = with_segments(equations, guess, rtol, SEGMENTS_MOST, parameter)
    maps = fine.transitions(guess[:-1], guess[-1], rtol, parameter)
    # Powers of two: few numbers of segments, few compilations.
    for segments in (1, 2, 4, 8, 16):
        grown = [largest(part) for part in np.split(maps, segments)]
        if np.max(grown) <= _GROWTH_INSIDE:
            return segments
    return SEGMENTS_MOST


def largest(maps: np.ndarray) -> float:
    """The largest derivative of the end of consecutive pieces by a state on the way."""
    total, largest = np.eye(maps.shape[-1]), 0.0
    for one in maps[::-1]:
        total = total @ one
        largest = max(largest, float(np.linalg.norm(total)))
    return largest


def with_segments(equations: Equations, guess, rtol, segments: int, parameter=0.0) -> Equations:
    """The equations with so many segments, short near encounters.

    They are about even in logarithmic time, where bodies attract each other; else the motion's
    fastest changes grow alike over each.
    """
    part = guess[-1] / equations.closing.parts
    ts = np.linspace(0.0, part, _SAMPLES)
    scene = equations.scene_at(jnp.asarray(parameter, float)).starting(guess[:-1], part)
    ys = solve(scene, part, ts=ts, rtol=rtol).ys
    if attracts(scene, ts, ys):
        s = float(logarithmic_span(scene, part))
        if np.isfinite(s):
            return _between_encounters(equations, scene, s, segments)
    fastest = np.asarray(_fastest(scene, ts, ys)) + 1 / part
    if not np.isfinite(fastest).all():
        return dataclasses.replace(equations, shares=(1 / segments,) * segments, s_spans=None)
    grown = np.append(0.0, np.cumsum(0.5 * (fastest[1:] + fastest[:-1])))
    ends = np.interp(np.linspace(0.0, grown[-1], segments + 1), grown, ts)
    shares = tuple((np.diff(ends) / part).tolist())
    return dataclasses.replace(equations, shares=shares, s_spans=None)


def _between_encounters(equations: Equations, scene: Scene, s: float, segments: int) -> Equations:
    """About even in logarithmic time, and cut where bodies are far apart.

    Within an encounter velocities are large and matter little, so that the closing equations of
    a cut there have lost their digits.
    """
    ts, depth = (np.asarray(z) for z in at_even_s(scene, s, _EVEN_RTOL, samples=_SAMPLES))
    middles = np.arange(1, segments) * _SAMPLES / segments
    half = 0.5 * _SAMPLES / segments
    windows = [np.arange(math.ceil(m - half), math.ceil(m + half)) for m in middles]
    cuts = [0, *(window[np.argmin(depth[window])] for window in windows), _SAMPLES]
    shares = tuple((np.diff(ts[cuts]) / ts[-1]).tolist())
    spans = tuple((np.diff(cuts) * (s / _SAMPLES)).tolist())
    return dataclasses.replace(equations, shares=shares, s_spans=spans)


@jax.jit
def _fastest(scene: Scene, ts: Array, ys: Array) -> Array:
    """(s,) rates of change along a motion: about the largest eigenvalue of the rate's slope.

    A root of a power's norm, since eigenvalues of thousands of matrices take longer than orbits.
    """
    slopes = jax.vmap(jax.jacfwd(scene.rate, argnums=1))(ts, ys)
    fourth = jnp.linalg.matrix_power(slopes, 4)
    return jnp.sqrt(jnp.sqrt(jnp.linalg.norm(fourth, axis=(1, 2))))
