"""Where in a box the zeros of a vector field can be: interval bisection.

A box in which the bounds of some entry of the field exclude 0 holds no zero. One in which
Krawczyk's operator

    K = c - Y f(c) + (1 - Y J(X)) (X - c),    Y about the inverse of J in the middle c of X,

maps the box X into its inside holds exactly one; where K misses X it holds none. Any other box is
bisected. What remains when boxes are tiny, or too many, is undecided: a zero at which the Jacobian
is singular, a curve of zeros, or a place where the field has no derivative. Everything else is
proved, since bounds allow for rounding (`solvers.intervals`).

Reference: Krawczyk (1969), Computing 4, 187; Neumaier (1990), Interval Methods for Systems of
Equations, chapter 5.
"""

from typing import NamedTuple

import numpy as np

from jaxdyn.solvers.enclosures import Dual, enclosures
from jaxdyn.solvers.formulas.formulas import Formulas
from jaxdyn.solvers.formulas.graph import Node
from jaxdyn.solvers.intervals import Interval, add, multiply

_MIN_BOX = 1e-9  # of the box: smaller boxes are not bisected
_MAX_WORK = 4_000_000  # boxes times operations: one to two seconds
_OVERLAP = 1.1  # boxes are examined with a margin, or a zero on a common side would be missed
_ROUNDING = 1e-14  # of sums of a few products, relative to their terms


class Isolation(NamedTuple):
    """Enclosures of the zeros of a field in a box, as boxes (number, k, 2) within it.

    Attributes:
      single: boxes with exactly one zero each, which may overlap.
      open: boxes in which there may be zeros.
      size: size of the undecided boxes, relative to the whole.
    """

    single: np.ndarray
    open: np.ndarray
    size: float


def isolate(formulas: Formulas, low: np.ndarray, high: np.ndarray) -> Isolation:
    """All boxes that may hold a zero of a rate.

    Args:
      formulas: elementary operations of the rate; made outside of any trace.
      low: (k,) lower corner of the box.
      high: (k,) upper corner, equal to the lower one for known entries.
    Raises:
      NotElementary: an operation without bounds.
    """
    field = _Equations(formulas, low, high)
    size = (high - low)[field.free]
    lows, highs = low[field.free, None], high[field.free, None]
    single, left, budget = [], [], _MAX_WORK // formulas.graph.count
    while lows.shape[1]:
        budget -= lows.shape[1]
        none, one = field.examine(lows, highs)
        small = ((highs - lows) <= _MIN_BOX * size[:, None]).all(axis=0)
        small |= budget < 0
        single.append(np.stack([lows, highs])[:, :, one])
        left.append(np.stack([lows, highs])[:, :, small & ~none & ~one])
        lows, highs = _halve(*(x[:, ~(none | one | small)] for x in (lows, highs)), size)
    boxes = (np.concatenate(part, axis=2) for part in (single, left))
    single, left = (field.boxes(part) for part in boxes)
    widths = (left[:, field.free, 1] - left[:, field.free, 0]) / size if len(left) else [0.0]
    return Isolation(single, left, float(np.max(widths)))


def _halve(lows: np.ndarray, highs: np.ndarray, size: np.ndarray) -> tuple:
    """Each box cut in two across its longest side."""
    widest = np.argmax((highs - lows) / size[:, None], axis=0)
    across = np.arange(len(size))[:, None] == widest
    middle = np.where(across, (lows + highs) / 2, 0.0)
    upper, lower = np.where(across, middle, highs), np.where(across, middle, lows)
    return np.concatenate([lows, lower], axis=1), np.concatenate([upper, highs], axis=1)


class _Equations:
    """The equations rate = 0 in the unknown entries of the state."""

    def __init__(self, formulas: Formulas, low: np.ndarray, high: np.ndarray):
        self.low, self.high, self.states = low, high, formulas.states
        self.free = np.flatnonzero(high > low)
        known = {formulas.states[i] for i in np.flatnonzero((high == low) & (low == 0))}
        self.rates = [x for x in formulas.rates if not (isinstance(x, Node) and x in known)]

    def boxes(self, cells: np.ndarray) -> np.ndarray:
        """Boxes (2, n, cells) of the unknowns as boxes (cells, k, 2) of states."""
        found = np.stack([self.low, self.high], axis=1)[None].repeat(cells.shape[2], axis=0)
        found[:, self.free] = np.transpose(cells, (2, 1, 0))
        return found

    def _bounds(self, box: Interval) -> tuple[Interval, Interval]:
        """(m, cells) of the equations and (m, n, cells) of their derivatives."""
        n, cells = box.low.shape
        inputs = {}
        for i, node in enumerate(self.states):
            slope = np.zeros((n, cells))
            slope[self.free == i] = 1.0
            ends = (
                np.append(x[self.free == i], np.full((1, cells), self.low[i]), 0)[0] for x in box
            )
            inputs[node] = Dual(Interval(*ends), Interval(slope, slope))
        found = enclosures(self.rates, inputs, cells)
        return _stack([x.value for x in found]), _stack([x.slope for x in found])

    def examine(self, lows: np.ndarray, highs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(cells,) which boxes provably hold no zero, and which exactly one."""
        centre = (lows + highs) / 2
        radius = _OVERLAP * (highs - lows) / 2
        value, slope = self._bounds(Interval(centre - radius, centre + radius))
        with np.errstate(all="ignore"):
            none = _excludes_zero(value)
            middle, _ = self._bounds(Interval(centre, centre))
            mean = middle
            for j in range(len(centre)):
                part = Interval(slope.low[:, j], slope.high[:, j])
                mean = add(mean, multiply(part, Interval(-radius[None, j], radius[None, j])))
            none |= _excludes_zero(mean)
            if len(self.rates) != len(self.free):
                return none, np.zeros_like(none)
            outside, inside = _krawczyk(middle, slope, radius)
            return none | outside, inside & ~none & ~outside


def _stack(parts: list[Interval]) -> Interval:
    return Interval(np.stack([x.low for x in parts]), np.stack([x.high for x in parts]))


def _excludes_zero(bounds: Interval) -> np.ndarray:
    return np.any((bounds.low > 0) | (bounds.high < 0), axis=0)


def _krawczyk(middle: Interval, slope: Interval, radius: np.ndarray) -> tuple:
    """(cells,) whether K misses the box, and whether it lies inside."""
    low, high = (np.moveaxis(x, -1, 0) for x in slope)
    f = [x.T for x in middle]
    known = np.all(np.isfinite(low) & np.isfinite(high), axis=(1, 2))
    known &= np.all(np.isfinite(f[0]) & np.isfinite(f[1]), axis=1)
    low, high = (np.where(known[:, None, None], x, 0.0) for x in (low, high))
    f, spread = (
        np.where(known[:, None], x, 0.0) for x in (np.add(*f) / 2, np.subtract(*f[::-1]) / 2)
    )
    a, wide, r = (low + high) / 2, (high - low) / 2, radius.T
    known &= np.linalg.det(a) != 0
    inverse = np.linalg.inv(np.where(known[:, None, None], a, np.eye(a.shape[1])))
    size = np.abs(inverse)
    shift = -np.einsum("cij,cj->ci", inverse, f)
    off = np.abs(np.eye(a.shape[1]) - inverse @ a) + size @ wide + _ROUNDING * (size @ np.abs(a))
    reach = np.einsum("cij,cj->ci", off, r)
    reach += np.einsum("cij,cj->ci", size, spread + _ROUNDING * np.abs(f))
    outside = (np.abs(shift) - reach > r).any(axis=1) & known
    inside = (np.abs(shift) + reach < r).all(axis=1) & known
    return outside, inside
