"""Krawczyk's test of the closing equations, in the orbit's units.

The theorem is that of `krawczyk` in `jaxdyn.ball_arithmetic`.
"""

import dataclasses

import numpy as np

from jaxdyn.ball_arithmetic.arithmetic import arb, arb_mat, float_matrix, precision
from jaxdyn.ball_arithmetic.krawczyk import Krawczyk, is_inside
from jaxdyn.ball_arithmetic.tube import Tube, tube
from orbits.proof.closing_equations import ClosingEquations

#: Most steps X -> K that reuse the D of the first X; each narrows K, at first by the contraction.
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
        error = system.unspared(system.residual(found.centre, centre))
        krawczyk = Krawczyk.of(error, jacobian, inverse)
        step = krawczyk(sides)
        passed = is_inside(step, sides)
        largest = before = _largest(step, own)
        for _ in range(_NARROWING if passed else 0):
            step = krawczyk(step)
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
                for row, to in zip(krawczyk.rest.tolist(), own, strict=True)
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
