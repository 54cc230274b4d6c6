"""Points of codimension two between two neighbours of a curve of special orbits.

Each kind has a test, a function of a point that changes sign there; its zero is located along the
curve by the Illinois method. At a cusp both parameters turn: the test is their change along the
curve, in the direction that it has before the cusp. The tests of the others, in `steps`, are those
of the multipliers besides the critical ones; at strong resonances of a torus point, of its angle.

Reference: Kuznetsov (2004), Elements of Applied Bifurcation Theory, 3rd edition, chapters 9 and 10.
"""

import dataclasses

import numpy as np

from orbits.curves.curve import CodimensionTwo, CurvePoint
from orbits.curves.extended import Extended
from orbits.curves.steps import point_at, solve
from orbits.curves.units import of_place, units_of
from orbits.families.family import Kind

#: Largest test at a special point.
GOAL = 1e-9
_STEPS = 50  # along the curve, to locate a point
_CLOSE = 1e-14  # of the interval: not divided further
#: Change of both parameters at a cusp, of their change in a step beside it.
_TURNED = 1e-6


def special_points(extended: Extended, a: CurvePoint, b: CurvePoint) -> list[CurvePoint]:
    """The points of codimension two between two neighbours, in order."""
    found = [_zero(extended, a, b, kind) for kind in a.tests]
    if extended.kind == Kind.FOLD:
        found.append(_cusp(extended, a, b))
    own = of_place(units_of(extended, a))
    along = a.tangent[extended.place] / own
    kept = [point for point in found if point is not None]
    return sorted(kept, key=lambda x: float(along @ (x.unknowns[extended.place] / own)))


def _zero(extended: Extended, a: CurvePoint, b: CurvePoint, kind) -> CurvePoint | None:
    best = _located(extended, a, b, lambda point: point.tests[kind])
    if best is None or abs(best.tests[kind]) > GOAL:
        return None
    return dataclasses.replace(best, kind=kind, residual=max(best.residual, abs(best.tests[kind])))


def _cusp(extended: Extended, a: CurvePoint, b: CurvePoint) -> CurvePoint | None:
    units = units_of(extended, a).parameters
    before = _turning(extended, a) / units

    def turned(point: CurvePoint) -> float:
        return float(_turning(extended, point) / units @ before)

    best = _located(extended, a, b, turned)
    if best is None:
        return None
    change = float(np.linalg.norm(_turning(extended, best) / units))
    # Elsewhere the curve only turns by a right angle in the plane of the parameters.
    if change > _TURNED * np.linalg.norm(before):
        return None
    return dataclasses.replace(best, kind=CodimensionTwo.CUSP)


def _turning(extended: Extended, point: CurvePoint) -> np.ndarray:
    """(2,) the change of the parameters along the curve."""
    return point.tangent[extended.place[-2:]]


def _located(extended: Extended, a: CurvePoint, b: CurvePoint, test) -> CurvePoint | None:
    """The point between two others where a test is zero; None where it has none."""
    left, right, side = test(a), test(b), 0
    # A zero at an end counts once, for the step that leads there.
    if not (left * right < 0 or right == 0 != left):
        return None
    best, least = (a, abs(left)) if abs(left) < abs(right) else (b, abs(right))
    low, high = 0.0, 1.0
    for _ in range(_STEPS):
        if least == 0 or high - low <= _CLOSE:
            break
        share = low + (high - low) * left / (left - right)
        point = between(extended, a, b, share)
        if point is None:
            break
        value = test(point)
        if abs(value) < least:
            best, least = point, abs(value)
        if value * left > 0:
            low, left, right = share, value, right * (0.5 if side < 0 else 1.0)
            side = -1
        else:
            high, right, left = share, value, left * (0.5 if side > 0 else 1.0)
            side = 1
    return best


def between(extended: Extended, a: CurvePoint, b: CurvePoint, share: float) -> CurvePoint | None:
    """The point of the curve after a share of the way from one to another."""
    units = units_of(extended, a)
    along, own = a.tangent[extended.place], of_place(units)
    here, there = a.unknowns[extended.place], b.unknowns[extended.place]
    guess = a.unknowns + share * (b.unknowns - a.unknowns)
    plane = here + share * (along / own @ ((there - here) / own)) * along
    found = solve(extended, guess, plane, along, units)
    return None if found is None else point_at(extended, found, along, units)
