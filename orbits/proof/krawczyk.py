"""Krawczyk's test of the closing equations in ball arithmetic.

Theorem (Krawczyk 1969, Computing 4, 187; Neumaier 1990, Interval Methods for Systems of Equations,
section 5.1). Let F be differentiable on a box X with centre x, D a matrix of intervals that
contains F'(z) for all z in X, C any matrix, and

    K = x - C F(x) + (1 - C D) (X - x).

If K lies in the interior of X, F has exactly one zero in X, and it lies in K.

Proof. For z in X the mean value theorem, row by row, gives F(z) - F(x) = M (z - x) with M in D,
since D is a box of matrices. So N(z) = z - C F(z) = x - C F(x) + (1 - C M)(z - x) lies in K, in the
interior of X, and N has a fixed point z in X (Brouwer). K in the interior of X needs
|1 - C D| r < r for the radii r of X, so that every C M is regular, hence also C, and F(z) = 0. Two
zeros z, w would have 0 = C (F(z) - F(w)) = C M (z - w) with C M regular, so that z = w.
"""

import dataclasses

import numpy as np

from jaxdyn.balls.arithmetic import arb, arb_mat, precision
from jaxdyn.balls.tube import Tube, tube
from orbits.proof.closing_equations import ClosingEquations, float_matrix

#: Most steps X -> K with the D of the first X; each narrows K, by the contraction at first.
_NARROWING = 100


@dataclasses.dataclass(frozen=True)
class Test:
    """The outcome of one test.

    Attributes:
      passed: whether K lies in the interior of X.
      numbers: enclosures of all numbers at the zero if the test passed, else X.
      tube: the tube about the motions from X over a part of the period.
      step: the largest entry of |K - x|, in units.
      contraction: norm of 1 - C D, in units.
    """

    passed: bool
    numbers: list
    tube: Tube
    step: float
    contraction: float


def krawczyk_test(
    system: ClosingEquations,
    numbers: list[arb],
    radius: arb,
    digits: float,
    bits: int,
    slope_digits: float,
    units: np.ndarray,
) -> Test:
    """Krawczyk's test on the box about the numbers with a radius in units (n) of the unknowns.

    Raises:
      NotEnclosed: no tube about the motions from the box is found.
    """
    with precision(bits):
        own = [arb(one) for one in units.tolist()]
        sides = [arb(0, 1) * radius * one for one in own]
        centre = list(numbers)
        box = list(numbers)
        for i, side in zip(system.unknowns, sides, strict=True):
            centre[i] = numbers[i].mid()
            box[i] = centre[i] + side
        found = enclosing_tube(system, centre, box, digits, bits, slope_digits)
        jacobian = system.jacobian(found.box, found.slopes, box)
        rows = system.residual_units[system.equations]
        scaled = np.linalg.inv(float_matrix(jacobian) * units / rows[:, None])
        inverse = arb_mat((scaled * units[:, None] / rows).tolist())
        error = system.column(system.residual(found.centre, centre))
        unit = arb_mat(
            [[int(i == j) for j in range(len(jacobian.tolist()))] for i in _range(jacobian)]
        )
        rest = unit - inverse * jacobian
        moved = inverse * error
        step = (rest * _column(sides) - moved).entries()
        passed = all(bool(abs(x) < radius * one) for x, one in zip(step, own, strict=True))
        largest = before = _largest(step, own)
        for _ in range(_NARROWING if passed else 0):
            # The zero lies in K, and D holds there as well.
            step = (rest * _column(step) - moved).entries()
            if not _largest(step, own) < 0.5 * before:
                break
            before = _largest(step, own)
        for i, change in zip(system.unknowns, step, strict=True):
            box[i] = centre[i] + change if passed else box[i]
        return Test(
            passed=passed,
            numbers=box,
            tube=found,
            step=float(largest),
            contraction=max(
                sum(float((abs(x) * of / to).upper()) for x, of in zip(row, own, strict=True))
                for row, to in zip(rest.tolist(), own, strict=True)
            ),
        )


def enclosing_tube(
    system: ClosingEquations, centre: list, box: list, digits: float, bits: int, slope_digits: float
) -> Tube:
    """The tube about the motions over a part of the period."""
    spans = system.period(centre) / system.parts, system.period(box) / system.parts
    starts = system.start(centre), system.start(box)
    return tube(
        system.field, arb(0), *starts, spans, digits, bits, slope_digits, sizes=system.sizes
    )


def _largest(vector: list, units: list) -> arb:
    return max((abs(x) / unit).upper() for x, unit in zip(vector, units, strict=True))


def _column(vector: list) -> arb_mat:
    return arb_mat([[x] for x in vector])


def _range(matrix: arb_mat) -> range:
    return range(matrix.nrows())
