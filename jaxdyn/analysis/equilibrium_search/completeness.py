"""Whether a search found all zeros in a box: a comparison with interval bisection.

`bisect` gives the boxes that hold exactly one zero each, and those that it cannot decide.
`judge` says whether each zero that is proved to exist was found, and what is left undecided.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._text import number_of
from jaxdyn.analysis.equilibrium_search.search import Box, low_discrepancy, rates
from jaxdyn.intervals import RIGOROUS, Interval
from jaxdyn.scene import Field
from jaxdyn.solvers.enclosures import Dual, enclosures
from jaxdyn.solvers.formulas.formulas import Formulas, formulas
from jaxdyn.solvers.formulas.graph import Node, NotElementary

# ---- Where in a box the zeros of a vector field can be: interval bisection
#
# A box in which the bounds of some entry of the field exclude 0 holds no zero. One in which
# Krawczyk's operator
#
#     K = c - Y f(c) + (1 - Y J(X)) (X - c),    Y about the inverse of J in the middle c of X,
#
# maps the box X into its inside holds exactly one; where K misses X it holds none (the theorem and
# its proof are in `ball_arithmetic.krawczyk`). Any other box is bisected. What remains when boxes
# are tiny, or too many, is undecided: a zero at which the Jacobian is singular, a curve of zeros,
# or a place where the field has no derivative. Everything else is proved, since bounds allow for
# rounding (`intervals`).

_MIN_BOX = 1e-9  # part of the box: smaller boxes are not bisected
_MAX_WORK = 4_000_000  # boxes times operations: one to two seconds
_OVERLAP = 1.1  # boxes are examined with a margin, or a zero on a common face would be missed
_ROUNDING = 1e-14  # rounding of sums of a few products, relative to their terms


class Isolation(NamedTuple):
    """Enclosures of the zeros of a field in a box, as boxes (number, k, 2) within it.

    Attributes:
      single: boxes with exactly one zero each, which may overlap.
      open: boxes in which there may be zeros.
      size: largest size of the undecided boxes, relative to the whole box.
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
        """The bounds (m, cells) of the equations and (m, n, cells) of their derivatives."""
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
        """(cells,) whether each box provably holds no zero, and whether exactly one."""
        centre = (lows + highs) / 2
        radius = _OVERLAP * (highs - lows) / 2
        value, slope = self._bounds(Interval(centre - radius, centre + radius))
        with np.errstate(all="ignore"):
            none = _excludes_zero(value)
            middle, _ = self._bounds(Interval(centre, centre))
            mean = middle
            for j in range(len(centre)):
                part = Interval(slope.low[:, j], slope.high[:, j])
                reach = Interval(-radius[None, j], radius[None, j])
                mean = RIGOROUS.add(mean, RIGOROUS.multiply(part, reach))
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


# ---- Whether a search found all zeros in a box: a comparison with interval bisection

_MARGIN = 1e-6  # part of the box, added on each side: a zero on its boundary would be lost
_POINT_SIZE = 1e-8  # part of the box: undecided boxes of this size mark points
_MERGE_DISTANCE = 1e-6  # part of the box: undecided boxes nearer than this mark one point
_DIRECTIONS = 256
_DISTANCES = (1.0, 1e2, 1e4)  # of samples of the rate, in sizes of the undecided place
#: Part of the rate at the farthest samples: a rate that is larger at all samples has no zero.
_MIN_RATE_WITHOUT_ZERO = 1e-3


class Proof(NamedTuple):
    """The result of interval bisection on a box.

    Attributes:
      box: the box, in which entries that must be 0 at rest are fixed.
      found: the boxes that may hold equilibria; None where nothing is known.
      why_not: the reason why nothing is known.
    """

    box: Box
    found: Isolation | None
    why_not: str = ""

    @property
    def middles(self) -> np.ndarray:
        """(s, k) middles of the boxes with exactly one equilibrium each: starts for a search."""
        boxes = self.found.single if self.found else np.zeros((0, len(self.box.low), 2))
        return np.clip(boxes.mean(axis=2), self.box.low, self.box.high)


def bisect(field: Field, t: Array, box: Box) -> Proof:
    """Interval bisection for the equilibria of a field in a box."""
    try:
        low = jnp.asarray(box.low)
        program = jax.make_jaxpr(lambda _, y: field.rate(t, y))(t, low)
        found = formulas(program, t, low)
        box = _at_rest(found, box)
        margin = _MARGIN * (box.high - box.low)
        return Proof(box, isolate(found, box.low - margin, box.high + margin))
    except NotElementary as error:
        return Proof(box, None, str(error))


def _at_rest(found: Formulas, box: Box) -> Box:
    """The box with entries fixed at 0 that are rates of others, such as velocities."""
    zero = [node in found.rates for node in found.states]
    zero = np.array(zero) & (box.low <= 0) & (box.high >= 0)
    if zero[box.free].all():
        return box
    return Box(np.where(zero, 0.0, box.low), np.where(zero, 0.0, box.high))


def judge(
    proof: Proof, field: Field, t: Array, ys: np.ndarray, jumps: np.ndarray
) -> tuple[bool, str]:
    """Whether zeros (s, k) are all of those in a box, and why, or why not, as text.

    Args:
      proof: the result of bisection.
      field: the field.
      t: () time.
      ys: (s, k) the zeros that were found.
      jumps: (j, k) points where the rate is 0 but discontinuous.
    """
    box = proof.box
    notes = ""
    if len(jumps):
        notes = f". Not listed: {_list(box, jumps)}, where the rate is 0 but discontinuous"
    uncertain = _why_uncertain(proof, field, t, ys)
    if uncertain:
        return False, f"not certain: {uncertain}{notes}"
    assert proof.found is not None
    discontinuous = [box.states(middle) for middle, _ in _places(box, proof.found.open)]
    if discontinuous:
        notes = (
            f" except the points {_list(box, discontinuous)}, where the rate is discontinuous; "
            f"samples around them show no equilibrium{notes}"
        )
    return True, f"complete: interval bisection excludes any other equilibrium in the box{notes}"


def _why_uncertain(proof: Proof, field: Field, t: Array, ys: np.ndarray) -> str:
    """Why the list of zeros may be incomplete or wrong; "" if it is proved."""
    box, found = proof.box, proof.found
    if found is None:
        return f"interval bisection has no bounds for the rate ({proof.why_not})"
    missed = [x.mean(axis=1) for x in found.single if not _within(ys, x).any()]
    if missed:
        return f"the search did not reach the equilibrium that exists near {_list(box, missed)}"
    if found.size > _POINT_SIZE:
        return (
            f"interval bisection could not decide {number_of(len(found.open), 'box', 'boxes')} of "
            f"up to {found.size:.1g} of the whole in size, as is usual along a curve of equilibria "
            "and with many unknowns"
        )
    places = _places(box, found.open)
    unclear = [middle for middle, size in places if not _nowhere_zero(field, t, box, middle, size)]
    if unclear:
        where = _list(box, [box.states(middle) for middle in unclear])
        return (
            f"near {where} the Jacobian is singular or the rate is not smooth: there may be no "
            "equilibrium, one, or several"
        )
    return ""


def _within(ys: np.ndarray, box: np.ndarray) -> np.ndarray:
    slack = box[:, 1] - box[:, 0]  # boxes are examined with a margin
    return np.all((ys >= box[:, 0] - slack) & (ys <= box[:, 1] + slack), axis=1)


def _list(box: Box, ys) -> str:
    """Distinct places as text, rounded to the distance at which boxes are merged."""
    size = (box.high - box.low)[box.free]
    rounded = [
        size * np.round(y[box.free] / size / _MERGE_DISTANCE) * _MERGE_DISTANCE + 0.0 for y in ys
    ]
    named = [", ".join(f"{x:.6g}" for x in place) for place in rounded]
    return ", ".join(f"({place})" for place in dict.fromkeys(named))


def _places(box: Box, cells: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Middle (n,) and radius of each group of neighbouring cells, in units of the box."""
    groups: list[list[np.ndarray]] = []
    for cell in cells:
        ends = box.units(cell.T)
        near = [
            g
            for g in groups
            if np.abs(g[0].mean(axis=0) - ends.mean(axis=0)).max() < _MERGE_DISTANCE
        ]
        if near:
            near[0].append(ends)
        else:
            groups.append([ends])
    spans = [(np.min(g, axis=(0, 1)), np.max(g, axis=(0, 1))) for g in groups]
    return [((low + high) / 2, float(np.max(high - low))) for low, high in spans]


def _nowhere_zero(field: Field, t: Array, box: Box, middle: np.ndarray, radius: float) -> bool:
    """Whether no sample of the rate about a place is near 0, compared with farther samples.

    A rate that is smooth and has a zero there decreases as the samples approach it.
    """
    directions = 2 * low_discrepancy(_DIRECTIONS, len(middle)) - 1
    directions /= np.abs(directions).max(axis=1, keepdims=True)
    points = np.stack([middle + far * radius * directions for far in _DISTANCES])
    ys = box.states(points.reshape(-1, len(middle)))
    found = np.abs(rates(field, t, ys)).reshape(len(_DISTANCES), len(directions), -1)
    sizes = found[-1].max(axis=0)
    moves = sizes > 0
    return bool((found[:, :, moves] / sizes[moves]).max(axis=2).min() > _MIN_RATE_WITHOUT_ZERO)
