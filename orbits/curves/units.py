"""The units of curves: the sizes of their orbits, a radian of the period, and parameters' units.

All lengths, angles, ranks and residuals are in these units, so that none depends on the units of
the scenes. The first orbit of a curve determines them; entries that grow along the curve have their
largest size so far. Special points have the units of the member before. The unit of a parameter
follows from the effect of the parameter, as along families (`orbits.families.sizes`).
"""

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxdyn.continuation.kinds import Kind
from jaxdyn.continuation.units import Units
from orbits.closing.sizes import sizes, sizes_along
from orbits.curves.curve import OrbitCurvePoint
from orbits.curves.extended import Extended, extended_make
from orbits.families.sizes import parameter_units
from orbits.motion import sample


def units_at(
    extended: Extended, states: np.ndarray, period: float, parameters: np.ndarray
) -> Units:
    """The units of an orbit from states (s, k) along it; the first one is its start."""
    scene = extended.make(*jnp.asarray(parameters)).starting(states[0], period)
    ts, ys = _motion(extended, scene, states)
    entry_sizes = sizes_along(scene, ys, sizes(scene))
    make, both = extended_make(extended.make, 0), jnp.asarray(parameters)
    by_effect = parameter_units(scene, make, both, ts, ys, entry_sizes)
    return Units(entry_sizes, by_effect, _radian(period))


def units_of(extended: Extended, point: OrbitCurvePoint) -> Units:
    """The units of a point; 1 for points from files of earlier versions, which have none."""
    if point.units is None:
        return Units(np.ones(extended.k), np.ones(2), 1.0)
    return Units.of(point.units, extended.k)


def as_member(extended: Extended, point: OrbitCurvePoint, sense: float = 1.0) -> OrbitCurvePoint:
    """A point as a member, with units that grow with its entries, and its tangent times `sense`."""
    units, unknowns = units_of(extended, point), extended.unpack(point.unknowns)
    scene = point.orbit.scene
    _, ys = _motion(extended, scene, np.asarray(unknowns.states))
    entry_sizes = np.maximum(units.each, sizes_along(scene, ys, sizes(scene)))
    units = units._replace(each=entry_sizes, time=_radian(float(unknowns.period)))
    length = np.linalg.norm(point.tangent[extended.place] / place_units(units))
    return dataclasses.replace(point, tangent=sense * point.tangent / length, units=units.numbers)


def place_units(units: Units) -> np.ndarray:
    """(k + 3,) the units of start, period and parameters."""
    return np.concatenate([units.each, [units.time], units.parameters])


def unknown_units(extended: Extended, units: Units) -> np.ndarray:
    """(n,) the units of all unknowns."""
    states = np.tile(units.each, (extended.segments, 1))
    vectors = np.tile(units.each, (extended.segments, extended.vectors, 1))
    # A fold's extra unknown is the multiple of the rate that is added to a vector.
    extra = units.time if extended.kind == Kind.FOLD else 1.0
    return extended.pack(states, vectors, units.time, units.parameters, extra)


def equation_units(extended: Extended, units: Units, count: int) -> np.ndarray:
    """(r,) the units of `count` equations: first of states, then of numbers without a unit."""
    joints = np.tile(units.each, (extended.segments - 1) * (1 + extended.vectors))
    closing = np.tile(extended.closing.residual_units(units.each), 1 + extended.vectors)
    return np.concatenate([joints, closing, np.ones(count - len(joints) - len(closing))])


def _motion(extended: Extended, scene, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(s,) times and (s, k) states along an orbit: starts of its segments, or a sampled motion."""
    part = float(scene.t1) / extended.closing.parts
    if extended.segments > 1:
        return np.arange(extended.segments) * part / extended.segments, states
    return sample(scene, part)


def _radian(period: float) -> float:
    return period / (2 * np.pi)
