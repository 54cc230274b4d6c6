"""The return map of a periodic chain of legs, linearised: flows of the legs and saltation matrices.

At an event g = 0 a neighbour arrives earlier or later. Seen at the same times, its deviation is
mapped by the saltation matrix

    S = C + (f+ - C f-) g' / (g' f-),

where C is the derivative of the change of the state, and f- and f+ are the rates before and after;
see R. I. Leine and H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems (2004),
section 7. So the flow has the multiplier 1, as in a smooth system. A leg without an event has
S = C.
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.integrate.simulation import rate_from
from orbits.analysis.monodromy import tangents
from orbits.closing.sizes import sizes
from orbits.hybrid.equations import closing_error, closing_in_sizes, pass_leg
from orbits.hybrid.legs import HybridOrbit, Leg

_SMALL = 1e-6  # relative values below this count as zero


class ReturnMap(NamedTuple):
    """The linearised return map of states in units of their sizes.

    Attributes:
      m: (d, d) the map on all that the closing compares.
      flow: (d,) the rate at the start, in the same basis.
      advances: number of directions that the closing does not compare.
    """

    m: np.ndarray
    flow: np.ndarray
    advances: int


class Transitions(NamedTuple):
    """The maps of states from the start of each leg to that of the next.

    Attributes:
      maps: (n, k, k) maps of deviations, in units of the sizes at both ends; they end at a grazed
        event.
      end: (k,) the state after the last leg, or after a grazed event.
      grazed: index of a leg that ends at an event that is grazed, not crossed; None without one.
    """

    maps: list[np.ndarray]
    end: np.ndarray
    grazed: int | None


class _Passage(NamedTuple):
    """The passage of a leg and of the event that ends it.

    Attributes:
      y: (k,) the start of the next leg.
      map: (k, k) the map of deviations from the start of the leg to that of the next one; not
        finite if the event is grazed.
      gradient: (k,) derivative of the event at the end with respect to the start; 0 without one.
      speed: () rate of change of the event at the end; 1 without one.
    """

    y: Array
    map: Array
    gradient: Array
    speed: Array


@eqx.filter_jit
def _pass(leg: Leg, after: Scene, y: Array, spans: tuple, rtol) -> _Passage:
    """The passage of a leg to the scene `after` of the next one, differentiable in all numbers.

    Where the rate jumps at the event, f- is taken just before the event and f+ just after it.

    Args:
      leg: the leg.
      after: the scene of the next one.
      y: (k,) start.
      spans: the durations of both.
      rtol: tolerance of the integration.
    """
    span, next_span = spans
    (y, *_), (by_start, by_span) = pass_leg(leg, y, span, rtol)
    step, change = by_start[0], by_span[0]
    if not leg.ends:
        return _Passage(y, step, jnp.zeros(step.shape[1]), jnp.ones(()))
    gradient, speed = by_start[1][0], by_span[1][0]
    change = rate_from(after, y, next_span, rtol=rtol) - change
    step = step + jnp.outer(change, gradient) / speed
    return _Passage(y, step, gradient, speed)


def transitions(orbit: HybridOrbit, rtol: float) -> Transitions:
    """The maps of a chain's legs, integrated at a tolerance, including those of their events.

    Raises:
      ValueError: the chain has constrained states.
    """
    traced = np.asarray(rtol, float)  # a Python number would be compiled in
    y, maps = np.asarray(orbit.y0), []
    units = [np.asarray(sizes(leg.scene)) for leg in orbit.legs]
    for i, leg in enumerate(orbit.legs):
        if tangents(leg.scene, np.asarray(leg.scene.y0)).shape[1] < len(y):
            remedy = "Write the legs in coordinates without constraints."
            raise fail(f"legs[{i}]", "free coordinates", "constrained ones", remedy)
        following, entry_sizes = (i + 1) % len(orbit.legs), units[i]
        after = orbit.legs[following].scene
        passed = _pass(leg, after, y, (leg.scene.t1, after.t1), traced)
        y, step, gradient, speed = map(np.asarray, passed)
        flow = _flow(leg.scene, leg.scene.y0, rtol)
        if not abs(speed) > _SMALL * np.abs(gradient * entry_sizes).sum() * _pace(
            flow, entry_sizes
        ):
            return Transitions(maps, y, i)
        maps.append(step * entry_sizes / units[following][:, None])
    return Transitions(maps, y, None)


def return_map(orbit: HybridOrbit, rtol: float) -> ReturnMap:
    """The return map of a chain, its legs integrated at a tolerance.

    Raises:
      ValueError: the chain grazes an event, has constrained states, or has a closing that is not a
        condition that the motion repeats itself.
    """
    scene = orbit.legs[0].scene
    entry_sizes = np.asarray(sizes(scene))
    start = np.asarray(orbit.y0)
    maps, y, grazed = transitions(orbit, rtol)
    if grazed is not None:
        remedy = "Where a chain grazes an event its return map has no derivative."
        raise fail(f"legs[{grazed}]", "an event that is crossed", "a grazed one", remedy)
    m = functools.reduce(lambda m, step: step @ m, maps)
    by_end, by_first = closing_in_sizes(orbit.closes, y, start, entry_sizes)
    q, lost = _compared(by_first)
    compared = by_end @ m
    if not (
        q.shape[1] and np.abs(compared @ lost).max(initial=0.0) <= _SMALL * np.abs(compared).max()
    ):
        remedy = "Close the chain by the difference of its ends, in all entries that repeat."
        raise fail("closes", "a condition that the motion repeats itself", "another one", remedy)
    back = np.linalg.pinv(by_first @ q)
    flow = _flow(scene, start, rtol) / entry_sizes
    return ReturnMap(-back @ compared @ q, q.T @ flow, lost.shape[1])


def differentiable_return_map(
    legs: Sequence[Leg], start: Array, spans: Array, known: HybridOrbit
) -> Array:
    """(d, d) the matrix of `return_map`, differentiable in every number of a chain.

    Args:
      legs: the legs of the chain.
      start: (k,) its start.
      spans: (n,) the duration of each leg.
      known: the chain on which it is based; its sizes and its basis are used.
    """
    y, rtol = start, np.asarray(known.rtol, float)
    m = jnp.eye(len(start))
    for i, leg in enumerate(legs):
        j = (i + 1) % len(legs)
        y, step, *_ = _pass(leg, legs[j].scene, y, (spans[i], spans[j]), rtol)
        m = step @ m
    # The directions that the closing does not compare may change with the numbers. But the map on
    # the quotient does not depend on the basis that represents it.
    with jax.ensure_compile_time_eval():
        entry_sizes = np.asarray(sizes(known.legs[0].scene))
        q, _ = _compared(closing_in_sizes(known.closes, known.y0, known.y0, entry_sizes)[1])
    by_end, by_first = (x * entry_sizes[None] for x in closing_error(known.closes, y, start)[1])
    back = jnp.linalg.pinv(by_first @ q)
    return -back @ by_end @ (m * entry_sizes[None] / entry_sizes[:, None]) @ q


def _compared(by_first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal bases (k, p) of the directions that a closing compares, (k, k - p) of others."""
    _, values, directions = np.linalg.svd(by_first)
    p = int((values > _SMALL * values.max(initial=0.0)).sum())
    return directions[:p].T, directions[p:].T


def _flow(scene: Scene, y, rtol: float) -> np.ndarray:
    """(k,) the rate at the start y (k,) of a leg with this scene."""
    return np.asarray(rate_from(scene, jnp.asarray(y), scene.t1, rtol=np.asarray(rtol, float)))


def _pace(flow: np.ndarray, entry_sizes: np.ndarray) -> float:
    return float(np.abs(flow / entry_sizes).max())


def without_flow(returns: ReturnMap) -> tuple[np.ndarray, bool]:
    """A basis without the direction of the flow, and whether the map preserves that direction.

    If it does not, the basis is complete. That happens if a leg of fixed duration is followed by
    another rate.
    """
    m, flow = returns.m, returns.flow
    kept = np.linalg.norm(flow) > 0 and np.linalg.norm(m @ flow - flow) <= _SMALL * (
        np.linalg.norm(flow) * max(1.0, np.linalg.norm(m, 2))
    )
    if not kept:
        return np.eye(len(m)), False
    return np.linalg.svd(flow[None])[2][1:].T, True
