"""Krawczyk's test of the closing equations in ball arithmetic.

Theorem (Krawczyk 1969, Computing 4, 187; Neumaier 1990, Interval Methods for Systems of Equations,
section 5.1). Let F be differentiable on a box X with centre x, D a matrix of intervals that
contains F'(z) for all z in X, C any matrix, and

    K = x - C F(x) + (1 - C D) (X - x).

If K lies in the interior of X, F has exactly one zero in X, and it lies in K.

Proof. For z in X the mean value theorem, row by row, gives F(z) - F(x) = M (z - x) with M in D,
since D is a box of matrices. So N(z) = z - C F(z) = x - C F(x) + (1 - C M)(z - x) lies in K, in the
interior of X, and N has a fixed point z in X (Brouwer). K in the interior of X needs
|1 - C D| r < r for the radii r of X, so that every C M is regular, hence C: F(z) = 0. Two zeros
z, w would have 0 = C (F(z) - F(w)) = C M (z - w) with C M regular: z = w.
"""

import dataclasses

import numpy as np

from jaxdyn.balls.arithmetic import arb, arb_mat, precision
from jaxdyn.balls.tube import Tube, tube
from orbits.proof.closing_equations import ClosingEquations, float_matrix

#: Steps X -> K with the D of the first X, each of which narrows K by the contraction at first.
_NARROWING = 100


@dataclasses.dataclass(frozen=True)
class Test:
    """The outcome of one test.

    Attributes:
      passed: whether K lies in the interior of X.
      numbers: enclosures of all numbers at the zero where it passed, else X.
      tube: about the motions from X over a part of the period.
      step: the largest entry of |K - x|.
      contraction: norm of 1 - C D.
    """

    passed: bool
    numbers: list
    tube: Tube
    step: float
    contraction: float


def tested(
    system: ClosingEquations,
    numbers: list[arb],
    radius: arb,
    digits: float,
    bits: int,
    slope_digits: float,
) -> Test:
    """Krawczyk's test on the box of this radius about the numbers.

    Raises:
      NotEnclosed: there is no tube about the motions from the box.
    """
    with precision(bits):
        side = arb(0, radius)
        centre = list(numbers)
        box = list(numbers)
        for i in system.unknowns:
            centre[i] = numbers[i].mid()
            box[i] = centre[i] + side
        found = enclosed(system, centre, box, digits, bits, slope_digits)
        jacobian = system.jacobian(found.box, found.slopes, box)
        inverse = arb_mat(np.linalg.inv(float_matrix(jacobian)).tolist())
        error = system.posed(system.residual(found.centre, centre))
        unit = arb_mat(
            [[int(i == j) for j in range(len(jacobian.tolist()))] for i in _range(jacobian)]
        )
        rest = unit - inverse * jacobian
        moved = inverse * error
        step = (rest * _column([side] * jacobian.nrows()) - moved).entries()
        passed = all(bool(abs(x) < radius) for x in step)
        largest = before = _largest(step)
        for _ in range(_NARROWING if passed else 0):
            # The zero lies in K, and D holds there as well.
            step = (rest * _column(step) - moved).entries()
            if not _largest(step) < 0.5 * before:
                break
            before = _largest(step)
        for i, change in zip(system.unknowns, step, strict=True):
            box[i] = centre[i] + change if passed else box[i]
        return Test(
            passed=passed,
            numbers=box,
            tube=found,
            step=float(largest),
            contraction=max(sum(float(abs(x).upper()) for x in row) for row in rest.tolist()),
        )


def enclosed(
    system: ClosingEquations, centre: list, box: list, digits: float, bits: int, slope_digits: float
) -> Tube:
    """The tube about the motions over a part of the period."""
    spans = system.period(centre) / system.parts, system.period(box) / system.parts
    starts = system.start(centre), system.start(box)
    return tube(system.field, arb(0), *starts, spans, digits, bits, slope_digits)


def _largest(vector: list) -> arb:
    return max(abs(x).upper() for x in vector)


def _column(vector: list) -> arb_mat:
    return arb_mat([[x] for x in vector])


def _range(matrix: arb_mat) -> range:
    return range(matrix.nrows())
