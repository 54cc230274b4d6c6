"""Special points between two neighbours of a family of equilibria.

Each kind has a test, a function of an equilibrium that changes sign there. Where it does, Newton's
method solves the defining equations of the kind; if it leads out of the interval, the interval is
halved first. Two points of a kind within one interval do not change the sign of its test; they are
detected by the number of eigenvalues that cross the imaginary axis, and the interval is halved
until each is in a part of its own. All points are in units of their family.

- Fold: the parameter entry of the tangent.
- Branch point: the determinant of [A, b] bordered by the tangent.
- Hopf point: the product of all sums of two eigenvalues. It vanishes also where two real ones are
  opposite (a neutral saddle), which is not a bifurcation.
- Krein collision, or Hamiltonian Hopf point: in a conservative scene, where eigenvalues come in
  pairs +-x and the product above is 0 everywhere, the discriminant of the polynomial whose zeros
  are the x^2. It has no equations of its own, but is located by this test.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from jaxdyn.analysis.eigenvalues import signed_least_sum
from jaxdyn.continuation import defining
from jaxdyn.continuation.branch import Correction, Place, changes_sign
from jaxdyn.continuation.family import Equilibrium, equilibrium_at
from jaxdyn.continuation.kinds import Kind
from jaxdyn.continuation.newton import Solution
from jaxdyn.continuation.normal_forms import first_lyapunov, null_form
from jaxdyn.continuation.units import ChartInUnits, InUnits

_HALVINGS = 25  # largest number of halvings of the interval between two members
_SHARE = 0.47  # where it is divided: a branch point with symmetry is often exactly half-way
_OUTSIDE = 1e-4  # part of it: a solution farther beyond its ends belongs to another place
_ROUNDING = 1e-13  # a smaller parameter entry of a tangent counts as 0
_EQUAL = 1e-8  # relative distance of squares of eigenvalues below which they are the same
_COLLIDES = 1e-6  # test at a Krein collision, relative to those of the members beside it
_KNOWN = 1e-12  # accuracy of the parameter of a Hopf point, in units of the parameter
_SAME_PLACE = 1e-6  # relative distance below which a fold and a branch point are the same


class EquilibriumChart(ChartInUnits[Equilibrium]):
    """A family of equilibria near a member."""

    def place(self, member: Equilibrium) -> Place:
        return Place(member.x, member.tangent)

    def correct(self, last: Equilibrium, start, plane) -> Correction | str:
        normal = np.stack([plane, last.tangent])
        found = defining.solve(defining.arc, self.make, start, normal)
        if found is None:
            return "Newton's method does not converge"
        point = equilibrium_at(self.make, found.x, last.tangent, found.residual)
        return Correction(found.x, found.iterations, point)


def special_points(
    chart: EquilibriumChart, a: Equilibrium, b: Equilibrium, first: bool = False
) -> list[Equilibrium]:
    """The special points between two neighbours, in order; with `first` also one at `a`."""
    passed = [kind for kind, test in _TESTS.items() if changes_sign(test(a), test(b), first)]
    hidden = _hidden(passed, a, b)
    if hidden is not None and not chart.at_end(a, b, _SHARE):
        middle = chart.between(a, b, _SHARE)
        if middle is not None:
            return [*special_points(chart, a, middle, first), *special_points(chart, middle, b)]
    found = [_locate(chart, kind, a, b) for kind in passed]
    found.append(_locate_collision(chart, a, b, first))
    if hidden is not None and _same(a, b):
        found.append(_double(hidden, b))
    known = [point for point in found if point is not None]
    branches = [point for point in known if point.kind == Kind.BRANCH]
    # A family that turns at a branch point has no fold there: the other branch passes it.
    kept = [x for x in known if x.kind != Kind.FOLD or not any(_same(x, y) for y in branches)]
    return sorted(kept, key=lambda point: float(a.tangent @ point.x))


def _hidden(passed: list[Kind], a: Equilibrium, b: Equilibrium) -> Kind | None:
    """The kind of two or more points between neighbours that no change of sign shows, or None."""
    (real_a, pairs_a), (real_b, pairs_b) = _count_growing(a), _count_growing(b)
    real, pairs = abs(real_b - real_a), abs(pairs_b - pairs_a)
    hopf = passed.count(Kind.HOPF)
    simple = len(passed) - hopf
    # Pairs that become real off the imaginary axis, or meet on it, are no Hopf points.
    crossed = abs(real_b + 2 * pairs_b - real_a - 2 * pairs_a)
    if real >= simple + 2 and crossed >= simple + 2:
        return Kind.BRANCH
    return Kind.HOPF if pairs >= hopf + 2 and crossed >= 2 * (hopf + 2) else None


def _double(kind: Kind, point: Equilibrium) -> Equilibrium:
    """The point where two or more eigenvalues cross at once, as they may by symmetry."""
    values = point.eigenvalues.values
    nearest = values[np.argmin(np.abs(values.real))]
    frequency = float(abs(nearest.imag)) if kind == Kind.HOPF else math.nan
    return dataclasses.replace(point, kind=kind, frequency=frequency)


def _count_growing(point: Equilibrium) -> tuple[int, int]:
    """The numbers of real eigenvalues, and of complex pairs, with positive real parts."""
    values, bars = point.eigenvalues
    growing, real = values.real > bars, np.abs(values.imag) <= bars
    return int(np.sum(growing & real)), int(np.sum(growing & (values.imag > bars)))


def _locate(
    chart: EquilibriumChart, kind: Kind, a: Equilibrium, b: Equilibrium
) -> Equilibrium | None:
    """The special point of a kind between two members whose tests differ in sign."""
    test, make = _TESTS[kind], chart.make
    for _ in range(_HALVINGS):
        left, right = test(a), test(b)
        # The guess is on the chord: the equations are singular at a branch point itself.
        guess = a.x + left / (left - right) * (b.x - a.x)
        solution = solution_of(make, kind, equilibrium_at(make, guess, a.tangent, np.nan))
        if solution is not None and _inside(a, b, solution.x[: len(a.x)]):
            return _with_coefficients(make, kind, a, solution)
        middle = chart.between(a, b, _SHARE)
        if middle is None:
            return None
        # Along a branch at constant parameter the tests are 0 everywhere, up to rounding.
        a, b = (a, middle) if changes_sign(left, test(middle), True) else (middle, b)
    return None


def _locate_collision(
    chart: EquilibriumChart, a: Equilibrium, b: Equilibrium, first: bool
) -> Equilibrium | None:
    """The Krein collision between two members, if there is one."""
    point = chart.locate(_discriminant, a, b, first=first)
    if point is None:
        return None
    beside = [x for x in (a, b) if x is not point]
    if abs(_discriminant(point)) > _COLLIDES * min(abs(_discriminant(x)) for x in beside):
        return None
    # Pairs that symmetry makes equal everywhere differ only by rounding, and do not collide.
    if any(_nearest(x)[0] < _EQUAL for x in beside):
        return None
    square = _nearest(point)[1]
    # Two real pairs meet as well, and may become complex, but are unstable on both sides.
    if square >= 0:
        return None
    return dataclasses.replace(point, kind=Kind.KREIN, frequency=math.sqrt(-square))


def _nearest(point: Equilibrium) -> tuple[float, float]:
    """The relative distance of the two nearest `_squares`, and the real part of their mean."""
    squares = _squares(point)
    i, j = np.triu_indices(len(squares), 1)
    if not len(i):
        return math.inf, math.nan
    apart = np.abs(squares[i] - squares[j])
    nearest = int(np.argmin(apart))
    mean = 0.5 * (squares[i] + squares[j])[nearest]
    return float(apart[nearest] / np.abs(squares).max()), float(mean.real)


def _squares(point: Equilibrium) -> np.ndarray:
    """The squares of non-zero eigenvalues in pairs +-x, each once; () if they are not in pairs."""
    values, bars = point.eigenvalues
    sums = np.abs(values[:, None] + values) - bars[:, None] - bars
    if (sums.min(axis=0) > 0).any():
        return np.zeros(0)
    on_axis = np.abs(values.real) <= bars
    return values[np.where(on_axis, values.imag > bars, values.real > 0)] ** 2


def _discriminant(point: Equilibrium) -> float:
    """The discriminant of the polynomial with the zeros of `_squares`; 1 if there are none."""
    squares = _squares(point)
    i, j = np.triu_indices(len(squares), 1)
    return float(np.prod((squares[i] - squares[j]) ** 2).real)


class Posed(NamedTuple):
    """The equations of a special point, and an approximate solution.

    Attributes:
      system: the equations, from `defining`.
      unknowns: (n,) the approximate solution.
      normal: the normalisation of its vectors.
    """

    system: defining.System
    unknowns: np.ndarray
    normal: np.ndarray


def pose(kind: Kind, start: Equilibrium) -> Posed | None:
    """The equations of a kind near an equilibrium; None without a pair of complex eigenvalues."""
    x, a = start.x, start.jacobian
    u, _, vt = np.linalg.svd(a)
    if kind == Kind.FOLD:
        return Posed(defining.fold, np.append(x, vt[-1]), vt[-1])
    if kind == Kind.BRANCH:
        return Posed(defining.branch, np.concatenate([x, u[:, -1], [0.0]]), u[:, -1])
    values, vectors = np.linalg.eig(a)
    i, j = np.triu_indices(len(values), 1)
    least = int(np.argmin(np.abs(values[i] + values[j])))
    i, j = int(i[least]), int(j[least])
    if values[i].imag == 0 or values[i] != np.conj(values[j]):
        return None
    q = vectors[:, i if values[i].imag > 0 else j]
    unknowns = np.concatenate([x, q.real, q.imag, [abs(values[i].imag)]])
    return Posed(defining.hopf, unknowns, np.stack([q.real, -q.imag]))


def locate(make: InUnits, near: Equilibrium, x: np.ndarray) -> Equilibrium | None:
    """The special point of the same kind as `near`, near a guess (k + 1,); None without any."""
    assert near.kind is not None
    solution = solution_of(make, near.kind, equilibrium_at(make, x, near.tangent, np.nan))
    return None if solution is None else _with_coefficients(make, near.kind, near, solution)


def solution_of(make: InUnits, kind: Kind, start: Equilibrium) -> Solution | None:
    """The solution of the equations of a kind, from an equilibrium nearby."""
    posed = pose(kind, start)
    if posed is None:
        return None
    return defining.solve(posed.system, make, posed.unknowns, posed.normal)


def _with_coefficients(
    make: InUnits, kind: Kind, before: Equilibrium, solution: Solution
) -> Equilibrium:
    """The special point with its coefficients."""
    k = len(before.state)
    x = solution.x[: k + 1]
    point = equilibrium_at(make, x, before.tangent, solution.residual)
    if kind == Kind.BRANCH:
        # Two directions are possible there; that of the neighbour is kept.
        point = dataclasses.replace(point, tangent=before.tangent)
    if kind == Kind.HOPF:
        frequency = float(abs(solution.x[-1]))
        point = dataclasses.replace(point, kind=kind, frequency=frequency)
        if point.is_zero_hopf:
            return point
        first = _first_lyapunov(make, x, point.jacobian, frequency)
        return dataclasses.replace(point, coefficient=first)
    form = null_form(make, x, point.jacobian, np.asarray(make.each))
    found = dict(zip(("coefficient", "cubic", "is_double"), form, strict=True))
    return dataclasses.replace(point, kind=kind, **found)


def _first_lyapunov(make: InUnits, x: np.ndarray, a: np.ndarray, frequency: float) -> float:
    """The first Lyapunov coefficient; 0 if its sign is uncertain, as the point's parameter is.

    With van der Pol's damping mu (1 - v^2) it is proportional to mu, and all orbits are at mu = 0.
    """
    each, along = np.asarray(make.each), np.eye(len(x))[-1]
    here, *beside = (
        first_lyapunov(make, x + off * along, a, frequency, each) for off in (0.0, -_KNOWN, _KNOWN)
    )
    return here if np.sign(beside[0]) == np.sign(beside[1]) else 0.0


def _inside(a: Equilibrium, b: Equilibrium, x: np.ndarray) -> bool:
    length = a.tangent @ (b.x - a.x)
    share = a.tangent @ (x - a.x) / length
    apart = np.linalg.norm(x - a.x - share * (b.x - a.x))
    return bool(-_OUTSIDE <= share <= 1 + _OUTSIDE and apart <= np.linalg.norm(b.x - a.x))


def _same(a: Equilibrium, b: Equilibrium) -> bool:
    return bool(np.linalg.norm(a.x - b.x) < _SAME_PLACE * (1.0 + np.linalg.norm(a.x)))


def _fold(point: Equilibrium) -> float:
    entry = float(point.tangent[-1])
    return 0.0 if abs(entry) < _ROUNDING else entry


def _branch(point: Equilibrium) -> float:
    """The determinant of the Jacobian bordered by the tangent, relative to its norm."""
    bordered = np.vstack([point.slopes, point.tangent])
    return float(np.linalg.det(bordered / np.linalg.norm(bordered, 2)))


def _hopf(point: Equilibrium) -> float:
    return signed_least_sum(*point.eigenvalues)


#: Functions of an equilibrium that change sign at special points.
_TESTS = {Kind.BRANCH: _branch, Kind.FOLD: _fold, Kind.HOPF: _hopf}
