"""Proved enclosures of all zeros of a rate in a box, by bisection with Krawczyk's test.

The theorem (`krawczyk`) leads from a box X to a box K: each zero of the rate in X lies in K, and
there is exactly one if K lies in the interior of X. So each box is discarded, by bounds of the rate
that exclude 0 or by a K that does not meet the box; or it has exactly one zero, which further steps
X -> K enclose more narrowly; or it is cut in two. Boxes that remain when they are tiny, or too
many, are reported.
"""

import itertools
from typing import NamedTuple

import numpy as np

from jaxdyn.ball_arithmetic.arithmetic import Undecided, arb, arb_mat, float_matrix, precision
from jaxdyn.ball_arithmetic.directions import excludes_zero, lengths
from jaxdyn.ball_arithmetic.field import BallField
from jaxdyn.ball_arithmetic.krawczyk import Krawczyk, is_inside

BITS = 160  # precision of the calculation
_WIDENED = 0.1  # share by which a box is widened to each side, so that it contains its boundary
_LEAST_SIZE = 1e-8  # boxes smaller than this share of the whole are not cut
_MOST_BOXES = 60_000
_STEPS = 12  # most steps that narrow the enclosure of a zero
_NARROW = 2.0**-140  # radius, as a share of the whole, at which an enclosure is narrow enough


class Zeros(NamedTuple):
    """The zeros of a rate in a box.

    Attributes:
      found: (e) boxes (k) with exactly one zero each.
      left: boxes (k) in which there may be other zeros.
      discarded: number of boxes without a zero.
      corners: the discarded boxes in which a length may be 0, so that the rate jumps.
    """

    found: list[list]
    left: list[list]
    discarded: int
    corners: list[list]


class _Equations:
    """The equations in the unknown entries of the state; velocities are 0 at rest."""

    def __init__(self, field: BallField, t: float, low: np.ndarray, high: np.ndarray):
        self.field, self.t, self.low, self.high = field, arb(t), low, high
        rates, states = field.rates.results, field.states
        known = (low <= 0) & (high >= 0) & np.array([node in rates for node in states])
        #: Indices of the rates that are not themselves one of those entries.
        fixed = [y for y, one in zip(states, known, strict=True) if one]
        self.rows = [i for i, x in enumerate(rates) if not any(x is y for y in fixed)]
        self.start = [arb(0) if one else arb(x) for one, x in zip(known, low, strict=True)]
        self.lengths = lengths(field)
        self.free = [i for i in range(len(states)) if not known[i] and high[i] > low[i]]

    def state(self, box: list) -> list:
        """(k) the state with a box of its unknown entries."""
        y = list(self.start)
        for i, x in zip(self.free, box, strict=True):
            y[i] = x
        return y

    def rate(self, box: list) -> list | None:
        """(m) the equations' left-hand sides; None if there are no bounds."""
        try:
            found = self.field.rate(self.t, self.state(box))
        except (Undecided, ZeroDivisionError):
            return None
        return [found[i] for i in self.rows]

    def exclude(self, box: list) -> bool:
        """Whether a box has no zero, where a unit vector without a direction prevents bounds."""
        return excludes_zero(self.field, self.lengths, self.rows, self.t, self.state(box))

    def slopes(self, box: list) -> arb_mat | None:
        """(m, n) derivatives of the left-hand sides; None if there are no bounds."""
        try:
            found = self.field.slopes(self.field.inputs(self.t, self.state(box)))
        except (Undecided, ZeroDivisionError):
            return None
        k = self.field.k
        rows = [[found[k + i * k + j] for j in self.free] for i in self.rows]
        return arb_mat(rows) if all(arb(x).is_finite() for row in rows for x in row) else None


def zeros(field: BallField, t: float, low: np.ndarray, high: np.ndarray) -> Zeros:
    """All zeros of a rate at time t in a box from `low` (k,) to `high` (k,), if separable."""
    with precision(BITS):
        equations = _Equations(field, t, low, high)
        free = equations.free
        sizes = [float(high[i] - low[i]) for i in free]
        todo = [[(float(low[i]), float(high[i])) for i in free]]
        found, left, corners, discarded = [], [], [], 0
        for count in itertools.count():
            if not todo:
                break
            cell = todo.pop()
            kind, narrow, alone = _examine(equations, cell, sizes)
            if kind in ("none", "corner"):
                discarded += 1
                if kind == "corner":
                    _join(corners, narrow)
            elif kind == "one":
                near = [wide for zero, wide in found if _same(narrow, zero)]
                if not near:
                    found.append((narrow, alone))
                elif not all(_inside(narrow, wide) for wide in near):
                    _join(left, narrow)
            elif count >= _MOST_BOXES or _is_small(cell, sizes):
                _join(left, [_hull(*ends) for ends in cell])
            else:
                todo += _halves(cell, sizes)
        inside = [box for box, _ in found if _meets(box, equations)]
        discarded += len(found) - len(inside)
        whole = [equations.state(box) for box in inside]
        left, corners = ([equations.state(box) for box in boxes] for boxes in (left, corners))
        return Zeros(whole, left, discarded, corners)


def _hull(low: float, high: float) -> arb:
    return arb(low).union(arb(high))


def _join(places: list[list], box: list) -> None:
    """Add a box to a list of disjoint ones, united with those that it touches."""
    for other in [x for x in places if _same(x, box)]:
        places.remove(other)
        box = [x.union(y) for x, y in zip(box, other, strict=True)]
    places.append(box)


def _same(a: list, b: list) -> bool:
    """Whether two boxes meet."""
    return all(x.overlaps(y) for x, y in zip(a, b, strict=True))


def _meets(box: list, equations: _Equations) -> bool:
    pairs = zip(box, equations.free, strict=True)
    return all(x.overlaps(_hull(equations.low[i], equations.high[i])) for x, i in pairs)


def _is_small(cell: list, sizes: list[float]) -> bool:
    pairs = zip(cell, sizes, strict=True)
    return all(high - low <= _LEAST_SIZE * size for (low, high), size in pairs)


def _halves(cell: list, sizes: list[float]) -> list[list]:
    widths = [(high - low) / size for (low, high), size in zip(cell, sizes, strict=True)]
    across = int(np.argmax(widths))
    low, high = cell[across]
    middle = (low + high) / 2
    parts = (low, middle), (middle, high)
    return [[*cell[:across], part, *cell[across + 1 :]] for part in parts]


def _examine(equations: _Equations, cell: list, sizes: list[float]) -> tuple[str, list, list]:
    """The number of zeros, "none", "one" or "" if unknown; an enclosure of one, and its box.

    It is a "corner" if it has none because the rate excludes 0 in all directions of a unit vector.
    """
    box = [_hull(*ends) for ends in cell]
    rates = equations.rate(box)
    if rates is not None and any(not x.contains(0) for x in rates):
        return "none", box, box
    if equations.lengths and equations.exclude(box):
        return "corner", box, box
    box = [x + (x - x.mid()) * (2 * _WIDENED) for x in box]
    found = _krawczyk(equations, box)
    if found is None:
        return "", box, box
    moved, is_alone = found
    if not all(x.overlaps(y) for x, y in zip(moved, box, strict=True)):
        return "none", box, box
    if not is_alone:
        return "", box, box
    for _ in range(_STEPS):
        if all(float(x.rad()) <= _NARROW * size for x, size in zip(moved, sizes, strict=True)):
            break
        again = _krawczyk(equations, moved)
        if again is None:
            break
        moved = [x.intersection(y) for x, y in zip(again[0], moved, strict=True)]
    return "one", moved, box


def _inside(inner: list, outer: list) -> bool:
    pairs = zip(inner, outer, strict=True)
    return all(bool(abs(x - y.mid()) < y.rad()) for x, y in pairs)


def _krawczyk(equations: _Equations, box: list) -> tuple[list, bool] | None:
    """Krawczyk's K of a box X, and whether it lies in the interior of X; None if there is none."""
    centre = [x.mid() for x in box]
    slopes, rates = equations.slopes(box), equations.rate(centre)
    n = len(box)
    if slopes is None or rates is None or len(rates) != n or not n:
        return None
    try:
        inverse = arb_mat(np.linalg.inv(float_matrix(slopes)).tolist())
    except np.linalg.LinAlgError:
        return None
    offset = [x - c for x, c in zip(box, centre, strict=True)]
    step = Krawczyk.of(rates, slopes, inverse)(offset)
    return [c + x for c, x in zip(centre, step, strict=True)], is_inside(step, offset)
