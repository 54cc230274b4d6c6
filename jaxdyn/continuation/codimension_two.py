"""Points of codimension two on a curve of folds or Hopf points: their tests, and their location.

Each kind has a test, a function of a point of the curve that changes sign there, and whose zero is
located along the curve. With the null vectors A v = 0, A^T w = 0, |v| = |w| = 1 of a fold, and B
the second derivative of the rate:

- Cusp: w B(v, v) / (1 + |B(v, v)|).
- Bogdanov-Takens point: w v on a curve of folds, the frequency squared on one of Hopf points.
- Bautin point (generalised Hopf): the first Lyapunov coefficient.
- Zero-Hopf and double Hopf point: the smallest of the eigenvalues besides the critical ones, or the
  smallest sum of two of them, with the sign of the product of all.

All but the tests of a cusp, and of a Bogdanov-Takens point on a curve of folds, are divided by
1 + |A|. Those two are products of unit vectors, which a large eigenvalue in another direction does
not affect.

Reference: Kuznetsov (2004), Elements of Applied Bifurcation Theory, 3rd edition, chapters 8 and 10.
"""

import dataclasses
import math

import numpy as np

from jaxdyn.analysis.eigenvalues import rate_eigenvalues, signed_least, signed_least_sum
from jaxdyn.continuation import augmented, normal_forms
from jaxdyn.continuation.branch import Correction, Place
from jaxdyn.continuation.curve import CurvePoint, MakeOfTwo, WithSecond
from jaxdyn.continuation.kinds import CodimensionTwo, Kind
from jaxdyn.continuation.newton import Solution
from jaxdyn.continuation.normal_forms import lyapunov_coefficients
from jaxdyn.continuation.units import ChartInUnits, Units
from jaxdyn.scales import Groups

#: Largest test at a special point. At a pole, where a test changes sign as well, it is large.
GOAL = 1e-10
_NOTHING = 1e-13  # a smaller test counts as 0: in conservative scenes some vanish everywhere
_SHORT = 0.98  # part of the way to a final Bogdanov-Takens point on which others are searched

Tests = dict[CodimensionTwo, float]


def point_at(
    curve: Kind, make: MakeOfTwo, found: Solution, along: np.ndarray, left: np.ndarray | None
) -> CurvePoint | None:
    """The record of a point; None where the curve has no tangent.

    Args:
      curve: kind of the curve.
      make: (p, q) -> scene.
      found: the solution of the point's equations.
      along: (k + 2,) vector along which its tangent is oriented.
      left: (k,) null vector of the neighbour, whose sign is kept.
    """
    size = len(along)
    unknowns, x = found.x, found.x[:size]
    tangent = augmented.tangent(curve, make, unknowns, along)
    if tangent is None:
        return None
    a = augmented.slopes(make, x)[:, :-1]
    held = WithSecond(make=make, second=np.asarray(x[-1]))
    values = rate_eigenvalues(a)
    if curve == Kind.FOLD:
        w = np.linalg.svd(a)[0][:, -1]
        w = w if left is None or w @ left >= 0 else -w
        tests, coefficient = _fold_tests(held, unknowns, values, a, w)
        frequency = math.nan
    else:
        w = np.full(len(a), np.nan)
        tests, coefficient = _hopf_tests(held, unknowns, values, a)
        frequency = math.sqrt(max(unknowns[-1], 0.0))
    return CurvePoint(
        curve=curve,
        state=x[:-2],
        parameters=x[-2:],
        eigenvalues=values,
        coefficient=coefficient,
        frequency=frequency,
        residual=found.residual,
        unknowns=unknowns,
        tangent=tangent,
        left=w,
        tests={kind: 0.0 if abs(t) <= _NOTHING else t for kind, t in tests.items()},
    )


def _fold_tests(make: WithSecond, unknowns, values, a, w: np.ndarray) -> tuple[Tests, float]:
    k = len(w)
    v = unknowns[k + 2 :] / np.linalg.norm(unknowns[k + 2 :])
    flat = np.append(v, 0.0)
    curvature = normal_forms.second(make, unknowns[: k + 1], flat, flat)
    quadratic = float(w @ curvature)
    product = float(w @ v)
    rest = np.delete(values.values, np.argmin(np.abs(values.values)))
    tests = {
        CodimensionTwo.CUSP: quadratic / (1.0 + float(np.linalg.norm(curvature))),
        CodimensionTwo.BOGDANOV_TAKENS: product,
        CodimensionTwo.ZERO_HOPF: signed_least_sum(rest, np.zeros(len(rest))) / _scale(a),
    }
    return tests, quadratic / (2 * product) if abs(product) > GOAL else math.nan


def _hopf_tests(make: WithSecond, unknowns, values, a: np.ndarray) -> tuple[Tests, float]:
    k, square = len(a), float(unknowns[-1])
    frequency = np.sqrt(complex(square))
    rest = values.values
    for critical in (1j * frequency, -1j * frequency):
        rest = np.delete(rest, np.argmin(np.abs(rest - critical)))
    first = math.nan
    if square > 0:
        each = np.asarray(make.make.each)
        first = normal_forms.first_lyapunov(make, unknowns[: k + 1], a, frequency.real, each)
    tests = {
        CodimensionTwo.BOGDANOV_TAKENS: square / _scale(a),
        CodimensionTwo.BAUTIN: first / _scale(a),
        CodimensionTwo.ZERO_HOPF: signed_least(rest, np.zeros(len(rest))) / _scale(a),
        CodimensionTwo.DOUBLE_HOPF: signed_least_sum(rest, np.zeros(len(rest))) / _scale(a),
    }
    return tests, first


def _scale(a: np.ndarray) -> float:
    return 1.0 + float(np.linalg.norm(a, 2))


class CurveChart(ChartInUnits[CurvePoint]):
    """A curve of folds or Hopf points near a member."""

    def __init__(self, make: MakeOfTwo, units: Units, known: Groups | None = None):
        super().__init__(make, units, known)
        self.measured = slice(len(units.x))  # state and parameters

    def place(self, member: CurvePoint) -> Place:
        return Place(member.unknowns, member.tangent)

    def correct(self, last: CurvePoint, start, plane) -> Correction | str:
        along = last.tangent[self.measured]
        found = augmented.solve(last.curve, self.make, start, plane[self.measured], along)
        if found is None:
            return "Newton's method does not converge"
        point = point_at(last.curve, self.make, found, along, last.left)
        if point is None:
            return "the curve has no tangent"
        return Correction(found.x, found.iterations, point)

    def zero(self, a, b, kind: CodimensionTwo, first: bool) -> CurvePoint | None:
        """The point between two neighbours where the test of a kind is zero; None without any."""
        best = self.locate(lambda point: point.tests[kind], a, b, first=first)
        return None if best is None or not _holds(best, kind) else best


def special_points(
    chart: CurveChart, a: CurvePoint, b: CurvePoint, first: bool = False
) -> list[CurvePoint]:
    """The points of codimension two between two neighbours, in order; `first`: also at `a`."""
    make, kinds, found = chart.make, list(a.tests), []
    if a.curve == Kind.HOPF:
        kinds.remove(CodimensionTwo.BOGDANOV_TAKENS)
        end = chart.zero(a, b, CodimensionTwo.BOGDANOV_TAKENS, first)
        if end is not None:
            found.append(_with_kind(make, end, CodimensionTwo.BOGDANOV_TAKENS))
            before = chart.between(a, end, _SHORT)
            b = a if before is None else before
    zeros = [(kind, chart.zero(a, b, kind, first)) for kind in kinds if b is not a]
    found += [_with_kind(make, point, kind) for kind, point in zeros if point is not None]
    along = a.tangent[chart.measured]
    return sorted(found, key=lambda point: float(along @ point.x))


def _holds(point: CurvePoint, kind: CodimensionTwo) -> bool:
    values, bars = point.eigenvalues
    size = 1.0 + np.abs(values).max()
    if abs(point.tests[kind]) > GOAL:
        return False
    if kind == CodimensionTwo.DOUBLE_HOPF or (
        kind == CodimensionTwo.ZERO_HOPF and point.curve == Kind.FOLD
    ):
        # Two real eigenvalues that are opposite are not a bifurcation.
        wanted = 4 if kind == CodimensionTwo.DOUBLE_HOPF else 2
        imaginary = (np.abs(values.real) <= math.sqrt(GOAL) * size) & (np.abs(values.imag) > bars)
        return int(imaginary.sum()) >= wanted
    return True


def _with_kind(make: MakeOfTwo, point: CurvePoint, kind: CodimensionTwo) -> CurvePoint:
    """The point with its kind and its normal form."""
    held = WithSecond(make=make, second=np.asarray(point.parameters[1]))
    # The Lyapunov coefficient has a pole at these kinds of points.
    poles = (CodimensionTwo.BOGDANOV_TAKENS, CodimensionTwo.ZERO_HOPF)
    pole = point.curve == Kind.HOPF and kind in poles
    x = point.x[:-1]
    a = augmented.slopes(make, point.x)[:, :-1]
    form, each = {}, np.asarray(make.each)
    if kind == CodimensionTwo.CUSP:
        form = {"c": normal_forms.null_form(held, x, a, each)[1]}
    elif kind == CodimensionTwo.BOGDANOV_TAKENS:
        form = dict(zip("ab", normal_forms.double_zero(held, x, a, each), strict=True))
    elif kind == CodimensionTwo.BAUTIN:
        form = {"l2": lyapunov_coefficients(held, x, a, point.frequency, each)[1]}
    return dataclasses.replace(
        point,
        kind=kind,
        coefficient=math.nan if pole else point.coefficient,
        residual=max(point.residual, abs(point.tests[kind])),
        normal_form={name: float(value) for name, value in form.items()},
    )
