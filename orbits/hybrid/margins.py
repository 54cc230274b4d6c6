"""How far a chain of legs is from grazing: numbers that change sign where it grazes.

A leg grazes the event at its end where it meets the event at zero speed. It grazes a bound where
the bound has a minimum of zero on the way. Beyond that the chain closes, but is not a motion: it
meets an event from its far side, or passes a bound.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.integrate.events import Event
from orbits.hybrid.equations import leg_passed
from orbits.hybrid.legs import HybridOrbit, Leg
from orbits.motion import quick_solve

_SAMPLES = 400  # samples of a leg to find a minimum, and about that sample to refine it


def margins(orbit: HybridOrbit) -> np.ndarray:
    """(e,) for each leg the speed at its event, and the smallest minimum of each of its bounds.

    For a bound without a minimum inside its leg, the number is its largest absolute value there.
    """
    found = []
    for leg in orbit.legs:
        if leg.ends:
            rtol = np.asarray(orbit.rtol, float)
            _, (_, by_span) = leg_passed(leg, np.asarray(leg.scene.y0), leg.scene.t1, rtol)
            found.append(float(by_span[1][0]))
        found += [_least_minimum(leg, bound, orbit.rtol) for bound in leg.bounds]
    return np.array(found)


def _least_minimum(leg: Leg, bound: Event, rtol: float) -> float:
    """The smallest local minimum of a bound inside a leg."""
    ts = np.linspace(0.0, float(leg.scene.t1), _SAMPLES + 1)
    values = _along(leg, bound, ts, rtol)
    inside = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])) + 1
    least = [_refine(leg, bound, ts[i - 1 : i + 2], rtol) for i in inside]
    return min(least, default=float(np.abs(values).max()))


def _refine(leg: Leg, bound: Event, ts: np.ndarray, rtol: float) -> float:
    """The minimum of a bound between three times."""
    values = _along(leg, bound, np.linspace(ts[0], ts[-1], _SAMPLES + 1), rtol)
    i = int(np.clip(np.argmin(values), 1, _SAMPLES - 1))
    left, middle, right = values[i - 1 : i + 2]
    bend = left - 2 * middle + right
    return float(middle - (right - left) ** 2 / (8 * bend)) if bend > 0 else float(middle)


def _along(leg: Leg, bound: Event, ts: np.ndarray, rtol: float) -> np.ndarray:
    ys = quick_solve(leg.scene, ts[-1], ts=ts, rtol=rtol).ys
    return np.asarray(_values(bound, jnp.asarray(ts), ys))


@eqx.filter_jit
def _values(bound: Event, ts: Array, ys: Array) -> Array:
    return jax.vmap(bound.value)(ts, ys)
