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
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail
from orbits.analysis.monodromy import tangents
from orbits.closing.sizes import rate, sizes
from orbits.hybrid.equations import closing_in_sizes, pass_leg
from orbits.hybrid.legs import HybridOrbit

_SMALL = 1e-6  # relative values below this are taken for zero


class ReturnMap(NamedTuple):
    """The linearised return map of states in units of their sizes.

    Attributes:
      m: (d, d) the map on all that the closing compares.
      flow: (d,) the rate at the start, in the same basis.
      advances: number of directions that the closing leaves out.
    """

    m: np.ndarray
    flow: np.ndarray
    advances: int


class Transitions(NamedTuple):
    """The maps of states from the start of each leg to that of the next.

    Attributes:
      maps: (n, k, k) maps of deviations, in units of the sizes at both ends, up to a grazed event.
      end: (k,) the state after the last leg, or after a grazed event.
      grazed: index of a leg that ends at an event that is grazed, not crossed; None without one.
    """

    maps: list[np.ndarray]
    end: np.ndarray
    grazed: int | None


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
        (y, *_), (by_start, by_span) = pass_leg(leg, y, leg.scene.t1, traced)
        step, change = np.asarray(by_start[0]), np.asarray(by_span[0])
        following, each = (i + 1) % len(orbit.legs), units[i]
        if leg.ends:
            after = orbit.legs[following].scene
            gradient, speed = np.asarray(by_start[1])[0], float(by_span[1][0])
            flow = np.asarray(_rate(leg.scene, leg.scene.y0))
            if not abs(speed) > _SMALL * np.abs(gradient * each).sum() * _pace(flow, each):
                return Transitions(maps, np.asarray(y), i)
            jump = np.asarray(_rate(after, y)) - change
            step = step + np.outer(jump, gradient) / speed
        maps.append(step * each / units[following][:, None])
    return Transitions(maps, np.asarray(y), None)


def return_map(orbit: HybridOrbit, rtol: float) -> ReturnMap:
    """The return map of a chain, its legs integrated at a tolerance.

    Raises:
      ValueError: the chain grazes an event, has constrained states, or has a closing that does not
        say that the motion repeats itself.
    """
    scene = orbit.legs[0].scene
    each = np.asarray(sizes(scene))
    start = np.asarray(orbit.y0)
    maps, y, grazed = transitions(orbit, rtol)
    if grazed is not None:
        remedy = "Where a chain grazes an event its return map has no derivative."
        raise fail(f"legs[{grazed}]", "an event that is crossed", "a grazed one", remedy)
    m = functools.reduce(lambda m, step: step @ m, maps)
    by_end, by_first = closing_in_sizes(orbit.closes, y, start, each)
    _, values, ways = np.linalg.svd(by_first)
    p = int((values > _SMALL * values.max(initial=0.0)).sum())
    q, lost = ways[:p].T, ways[p:].T
    compared = by_end @ m
    if not (p and np.abs(compared @ lost).max(initial=0.0) <= _SMALL * np.abs(compared).max()):
        remedy = "Close the chain by the difference of its ends, less what the motion is free in."
        raise fail("closes", "a condition that the motion repeats itself", "another one", remedy)
    back = np.linalg.pinv(by_first @ q)
    flow = np.asarray(_rate(scene, start)) / each
    return ReturnMap(-back @ compared @ q, q.T @ flow, len(start) - p)


def _pace(flow: np.ndarray, each: np.ndarray) -> float:
    return float(np.abs(flow / each).max())


@eqx.filter_jit
def _rate(scene: Scene, y) -> Array:
    return rate(scene, 0.0, y)


def without_flow(returns: ReturnMap) -> tuple[np.ndarray, bool]:
    """(basis, whether the map keeps the direction of the flow), where the basis omits a kept flow.

    The map does not keep it if a leg lasts a fixed time and is followed by another rate.
    """
    m, flow = returns.m, returns.flow
    kept = np.linalg.norm(flow) > 0 and np.linalg.norm(m @ flow - flow) <= _SMALL * (
        np.linalg.norm(flow) * max(1.0, np.linalg.norm(m, 2))
    )
    if not kept:
        return np.eye(len(m)), False
    return np.linalg.svd(flow[None])[2][1:].T, True
