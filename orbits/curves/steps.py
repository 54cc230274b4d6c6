"""Points of a curve: each is in a plane near a start, and has its multipliers and tests."""

import math

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn.analysis.eigenvalues import map_eigenvalues, map_in_units, signed_least
from jaxdyn.continuation import newton
from jaxdyn.continuation.branch import Chart, Correction, Place
from jaxdyn.continuation.kinds import CodimensionTwo, Kind
from jaxdyn.continuation.newton import Solution
from jaxdyn.continuation.units import Units
from orbits.closing.given import loses_drive
from orbits.curves.curve import OrbitCurvePoint
from orbits.curves.extended import Extended, Frame
from orbits.curves.units import as_member, equation_units, place_units, units_of, unknown_units
from orbits.orbit import Orbit, Outcome

#: Largest residual of a point, relative to 1 + the largest entry of its unknowns, in units.
GOAL = 1e-10
#: A test that vanishes all along a curve, as where determinants are 1, is noise below this
#: multiple of the tolerance.
_NOISE = 100.0
_DEPENDENT = 1e-13  # smaller singular values, relatively, belong to dependent equations


def solve(
    extended: Extended, start: np.ndarray, point: np.ndarray, along: np.ndarray, units: Units
) -> Solution | None:
    """The point of a curve in a plane, near a start; None if Newton's method finds none.

    The unknowns of the result are not in units, its Jacobian is; its `more` is M (k, k).

    Args:
      extended: the equations.
      start: (n,) unknowns.
      point: (k + 3,) start, period and parameters in the plane.
      along: (k + 3,) the normal of the plane, orthogonal to it in units.
      units: the units.
    """
    frame = frame_at(extended, start, point, along, units)
    x_units = unknown_units(extended, units)

    def equations(x: np.ndarray) -> tuple:
        if not extended.unpack(x).period > 0:
            return np.full(1, np.nan), np.zeros((1, len(x)))  # no orbit
        value, jacobian, monodromy = extended(x * x_units, frame)
        rows = equation_units(extended, units, len(value))
        return value / rows, jacobian * x_units / rows[:, None], monodromy

    found = newton.solve(equations, start / x_units, rank=_DEPENDENT)
    good = found.settled and found.residual <= GOAL * (1.0 + np.abs(found.x).max())
    return found._replace(x=found.x * x_units) if good else None


class CurveChart(Chart[OrbitCurvePoint]):
    """A curve near a member, in units.

    Attributes:
      extended: the equations.
      units: the units of the member.
    """

    def __init__(self, extended: Extended, member: OrbitCurvePoint):
        self.extended, self.units = extended, units_of(extended, member)
        self.measured = extended.place

    def place(self, member: OrbitCurvePoint) -> Place:
        x_units = unknown_units(self.extended, self.units)
        return Place(member.unknowns / x_units, member.tangent / x_units)

    def correct(self, last: OrbitCurvePoint, start, plane) -> Correction | str:
        x_units = unknown_units(self.extended, self.units)
        along, point = last.tangent[self.measured], (plane * x_units)[self.measured]
        found = solve(self.extended, start * x_units, point, along, self.units)
        if found is None:
            return "Newton's method does not converge"
        new = point_at(self.extended, found, along, self.units)
        if self.extended.driven and loses_drive(new.orbit.scene, float(new.orbit.period)):
            return "the drive vanishes"
        return Correction(found.x / x_units, found.iterations, new)

    def outward(self, member: OrbitCurvePoint) -> OrbitCurvePoint:
        return member if member.kind else as_member(self.extended, member)


def point_at(
    extended: Extended, found: Solution, along: np.ndarray, units: Units
) -> OrbitCurvePoint:
    """The record of a point; its tangent has the direction of `along` (k + 3,), in units."""
    tangent = np.linalg.svd(found.jacobian[:-1])[2][-1]
    place = tangent[extended.place]
    sign = 1.0 if place @ (along / place_units(units)) >= 0 else -1.0
    tangent = sign * tangent / np.linalg.norm(place)
    unknowns = extended.unpack(found.x)
    orbit = orbit_of(extended, found.x, found.residual, found.iterations)
    values = reduced_multipliers(extended, orbit, found.more[0], units.each)
    cosine = float(unknowns.extra)
    torus = extended.kind == Kind.TORUS
    return OrbitCurvePoint(
        curve=extended.kind,
        orbit=orbit,
        parameters=np.asarray(unknowns.parameters),
        multipliers=values,
        angle=math.acos(min(max(cosine, -1.0), 1.0)) if torus else math.nan,
        residual=found.residual,
        unknowns=found.x,
        tangent=tangent * unknown_units(extended, units),
        tests=_tests(extended, values, cosine),
        units=units.numbers,
    )


def orbit_of(extended: Extended, x: np.ndarray, residual: float, iterations: int) -> Orbit:
    """The orbit at the unknowns x (n,)."""
    unknowns = extended.unpack(x)
    scene = extended.make(*unknowns.parameters)
    return Orbit(
        scene=scene.starting(unknowns.states[0], unknowns.period),
        closing=extended.closing,
        residual=residual,
        outcome=Outcome.FOUND,
        iterations=iterations,
        rtol=extended.rtol,
    )


def partial_return(extended: Extended, orbit: Orbit, monodromy: np.ndarray) -> np.ndarray:
    """(k, k) the map over a part of the period, then the inverse of the closing's symmetry."""
    system, y0 = orbit.scene.system, orbit.y0

    def miss(end, start):
        return extended.closing.residual(system, end, start, jnp.zeros(()))

    # At an orbit the end is g y0, so that the miss vanishes.
    end = extended.closing.act(system, y0, jnp.zeros(()))
    after, before = (np.asarray(jax.jacfwd(miss, i)(end, y0)) for i in (0, 1))
    return np.linalg.solve(-before, after @ monodromy)


def reduced_multipliers(
    extended: Extended, orbit: Orbit, monodromy: np.ndarray, entry_sizes: np.ndarray
):
    """The multipliers of the map over a part of the period, without the one along the flow.

    The entries of the state have sizes `entry_sizes` (k,).
    """
    m = map_in_units(partial_return(extended, orbit, monodromy), entry_sizes)
    if not extended.driven:
        flow = np.asarray(orbit.scene.rate(0.0, orbit.y0)) / entry_sizes
        q = np.linalg.svd(flow[:, None])[0][:, 1:]
        m = q.T @ m @ q
    growth = np.linalg.norm(map_in_units(monodromy, entry_sizes), 2)
    return map_eigenvalues(m, extended.rtol * growth)


def _tests(extended: Extended, found, cosine: float) -> dict[CodimensionTwo, float]:
    if extended.closing.parts > 1:
        return {}  # the multipliers are not those of a whole period
    kind, c = extended.kind, CodimensionTwo
    values, bars = found
    noise = _NOISE * extended.rtol * np.prod(1 + np.abs(values))
    rest, rest_bars = _besides(kind, values, bars, cosine)
    i, j = np.triu_indices(len(rest), 1)
    pair = signed_least(rest[i] * rest[j] - 1, rest_bars[i] + rest_bars[j])
    if kind == Kind.FOLD:
        tests = {c.RESONANCE_1_1: _slope(values, 1), c.FOLD_FLIP: _value(values, -1)}
        tests |= {c.FOLD_TORUS: pair}
    elif kind == Kind.DOUBLING:
        tests = {c.RESONANCE_1_2: _slope(values, -1), c.FOLD_FLIP: _value(values, 1)}
        tests |= {c.FLIP_TORUS: pair}
    else:
        tests = {c.RESONANCE_1_1: 1 - cosine, c.RESONANCE_1_2: 1 + cosine}
        tests |= {c.RESONANCE_1_3: 0.5 + cosine, c.RESONANCE_1_4: cosine}
        tests |= {c.FOLD_TORUS: _value(rest, 1), c.FLIP_TORUS: _value(rest, -1)}
        tests |= {c.DOUBLE_TORUS: pair}
    return {kind: 0.0 if abs(test) <= noise else test for kind, test in tests.items()}


def _besides(kind: Kind, values, bars, cosine: float):
    """The multipliers other than the critical ones, with their bars."""
    turn = np.exp(1j * np.arccos(complex(cosine)))
    critical = {Kind.FOLD: [1.0], Kind.DOUBLING: [-1.0], Kind.TORUS: [turn, 1 / turn]}
    for value in critical[kind]:
        nearest = np.argmin(np.abs(values - value))
        values, bars = np.delete(values, nearest), np.delete(bars, nearest)
    return values, bars


def _value(values: np.ndarray, at: float) -> float:
    """The characteristic polynomial: the product of all differences, or 1 if there is none."""
    return float(np.prod(at - values).real)


def _slope(values: np.ndarray, at: float) -> float:
    """The derivative of the characteristic polynomial; at a zero, the product of other differences.

    The sum is smooth where two multipliers meet, each of which then has only half of the digits.
    """
    others = [np.prod(at - np.delete(values, i)) for i in range(len(values))]
    return float(np.sum(others).real)


def frame_at(extended: Extended, start, point, along, units: Units) -> Frame:
    """The frame at unknowns, with the plane through a point and normal to `along`, in units."""
    unknowns, entry_sizes = extended.unpack(start), units.each
    w = unknowns.vectors[0] / entry_sizes
    first = w[0] / np.linalg.norm(w[0])
    rows = first[None]
    if extended.kind == Kind.TORUS:
        across = w[1] - (first @ w[1]) * first
        rows = np.stack([first, across / np.linalg.norm(across)])
    y0 = unknowns.states[0]
    flow = np.asarray(extended.make(*unknowns.parameters).rate(jnp.zeros(()), jnp.asarray(y0)))
    flow = flow / entry_sizes
    normal = along / place_units(units)
    return Frame(
        sizes=entry_sizes,
        time=units.time,
        rows=rows / entry_sizes,
        start=y0,
        flow=flow / (np.linalg.norm(flow) or 1.0) / entry_sizes,
        point=point,
        along=normal / (np.linalg.norm(normal) or 1.0) / place_units(units),
    )
