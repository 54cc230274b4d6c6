"""Points of codimension two between two neighbours of a curve of special orbits.

Each kind has a test, a function of a point that changes sign there; its zero is located along the
curve (`Chart.locate`). At a cusp both parameters turn: the test is their change along the
curve, in the direction that it has before the cusp. The tests of the others, in `steps`, are those
of the multipliers besides the critical ones; at strong resonances of a torus point, of its angle.

Reference: Kuznetsov (2004), Elements of Applied Bifurcation Theory, 3rd edition, chapters 9 and 10.
"""

import dataclasses

import numpy as np

from jaxdyn.continuation.kinds import CodimensionTwo, Kind
from orbits.curves.curve import OrbitCurvePoint
from orbits.curves.steps import CurveChart

#: Largest test at a special point.
GOAL = 1e-9
#: Change of both parameters at a cusp, of their change in a step beside it.
_TURNED = 1e-6


def special_points(
    chart: CurveChart, a: OrbitCurvePoint, b: OrbitCurvePoint
) -> list[OrbitCurvePoint]:
    """The points of codimension two between two neighbours, in order."""
    found = [_zero(chart, a, b, kind) for kind in a.tests]
    if chart.extended.kind == Kind.FOLD:
        found.append(_cusp(chart, a, b))
    kept = [point for point in found if point is not None]
    return sorted(kept, key=lambda point: chart.along(a, point))


def _zero(
    chart: CurveChart, a: OrbitCurvePoint, b: OrbitCurvePoint, kind
) -> OrbitCurvePoint | None:
    best = chart.locate(lambda point: point.tests[kind], a, b)
    if best is None or abs(best.tests[kind]) > GOAL:
        return None
    return dataclasses.replace(best, kind=kind, residual=max(best.residual, abs(best.tests[kind])))


def _cusp(chart: CurveChart, a: OrbitCurvePoint, b: OrbitCurvePoint) -> OrbitCurvePoint | None:
    before = _turning(chart, a)
    best = chart.locate(lambda point: float(_turning(chart, point) @ before), a, b)
    if best is None:
        return None
    # Elsewhere the curve only turns by a right angle in the plane of the parameters.
    if np.linalg.norm(_turning(chart, best)) > _TURNED * np.linalg.norm(before):
        return None
    return dataclasses.replace(best, kind=CodimensionTwo.CUSP)


def _turning(chart: CurveChart, point: OrbitCurvePoint) -> np.ndarray:
    """(2,) the change of the parameters along the curve, in units."""
    return point.tangent[chart.measured[-2:]] / chart.units.parameters
