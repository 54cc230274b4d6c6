"""Whether a search found all zeros in a box: a comparison with interval bisection.

`bisect` gives the boxes that hold exactly one zero each, and those that it cannot decide.
`judge` says whether each zero that is proved to exist was found, and what the others may hold.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._text import number_of
from jaxdyn.analysis.equilibrium_search.isolation import Isolation, isolate
from jaxdyn.analysis.equilibrium_search.search import Box, low_discrepancy, rates
from jaxdyn.scene import Field
from jaxdyn.solvers.formulas.formulas import Formulas, formulas
from jaxdyn.solvers.formulas.graph import NotElementary

_MARGIN = 1e-6  # of the box: margin of the bisected box, or a zero on its boundary would be lost
_POINT_SIZE = 1e-8  # of the box: undecided boxes of this size mark points
_MERGE_DISTANCE = 1e-6  # of the box: undecided boxes nearer than this mark one point
_DIRECTIONS = 256
_DISTANCES = (
    1.0,
    1e2,
    1e4,
)  # of the size of an undecided place: where the rate is sampled about it
#: Of its size there: a rate larger than this at all samples has no zero.
_MIN_RATE_WITHOUT_ZERO = 1e-3


class Proof(NamedTuple):
    """The result of interval bisection on a box.

    Attributes:
      box: without the entries that must be 0 at rest.
      found: the boxes that may hold equilibria; None where nothing is known.
      why_not: the reason why nothing is known.
    """

    box: Box
    found: Isolation | None
    why_not: str = ""

    @property
    def middles(self) -> np.ndarray:
        """(s, k) of the boxes with exactly one equilibrium each: where a search should start."""
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
    """The box without entries that are rates of others, such as velocities, which are 0."""
    zero = [node in found.rates for node in found.states]
    zero = np.array(zero) & (box.low <= 0) & (box.high >= 0)
    if zero[box.free].all():
        return box
    return Box(np.where(zero, 0.0, box.low), np.where(zero, 0.0, box.high))


def judge(
    proof: Proof, field: Field, t: Array, ys: np.ndarray, jumps: np.ndarray
) -> tuple[bool, str]:
    """Whether zeros (s, k) are all in a box, and why, or why not, as text.

    Args:
      proof: the result of bisection.
      field: the field.
      t: () time.
      ys: (s, k) the zeros that were found.
      jumps: (j, k) points where the rate is 0 but discontinuous.
    """
    box = proof.box
    said = ""
    if len(jumps):
        said = f". Not listed: {_list(box, jumps)}, where the rate is 0 but discontinuous"
    doubt = _doubt(proof, field, t, ys)
    if doubt:
        return False, f"not certain: {doubt}{said}"
    assert proof.found is not None
    sharp = [box.states(middle) for middle, _ in _places(box, proof.found.open)]
    if sharp:
        said = (
            f" except the points {_list(box, sharp)}, where the rate is discontinuous; samples "
            f"around them show no equilibrium{said}"
        )
    return True, f"complete: interval bisection excludes any other equilibrium in the box{said}"


def _doubt(proof: Proof, field: Field, t: Array, ys: np.ndarray) -> str:
    """Why there may be more, or fewer; "" if there is no doubt."""
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
    ways = 2 * low_discrepancy(_DIRECTIONS, len(middle)) - 1
    ways /= np.abs(ways).max(axis=1, keepdims=True)
    points = np.stack([middle + far * radius * ways for far in _DISTANCES])
    ys = box.states(points.reshape(-1, len(middle)))
    found = np.abs(rates(field, t, ys)).reshape(len(_DISTANCES), len(ways), -1)
    sizes = found[-1].max(axis=0)
    moves = sizes > 0
    return bool((found[:, :, moves] / sizes[moves]).max(axis=2).min() > _MIN_RATE_WITHOUT_ZERO)
