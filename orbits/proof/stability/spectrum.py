"""Linear stability as a theorem: enclosures of the multipliers that theory does not fix.

`structure` says which multipliers are 1, or exp(+-i a) for a relative orbit with the angle a.

That multipliers are on the unit circle is proved as follows. If M is symplectic, or similar to its
inverse by a reversal of the orbit, then with a multiplier z there is 1 / conj z, with the same
multiplicity. The prescribed multipliers are on the circle and are mapped to themselves, so the
others are mapped to each other. If each enclosure contains one multiplier, and its image under that
reflection meets no other enclosure, then z = 1 / conj z, that is |z| = 1. Multipliers on the circle
that are distinct, and distinct from those that are known, mean linear stability (Kapela, Simo 2007,
Nonlinearity 20, 1241).
"""

import contextlib
import dataclasses

import numpy as np

from jaxdyn.ball_arithmetic.arithmetic import acb, arb_mat, precision
from jaxdyn.ball_arithmetic.tube import NotEnclosed
from orbits.proof.closing_equations import ClosingEquations
from orbits.proof.krawczyk import enclosing_tube
from orbits.proof.stability import multipliers
from orbits.proof.stability.structure import Prescribed, Structure, prescribe


@dataclasses.dataclass(frozen=True)
class Spectrum:
    """The non-trivial multipliers and what they prove.

    Attributes:
      values: enclosures, one for each multiplier; empty if these cannot be separated.
      verdict: "stable", "unstable" or "undecided".
    """

    values: list[acb]
    verdict: str


def spectrum(
    system: ClosingEquations,
    numbers: list,
    slopes: arb_mat,
    known: Structure,
    digits: float,
    bits: int,
) -> Spectrum:
    """The non-trivial multipliers of an orbit.

    Args:
      system: the closing equations.
      numbers: enclosures of all numbers of these equations.
      slopes: the derivative over a part of the period, for all motions of a wider box. It is
        enclosed again, for sharper multipliers.
      known: what is known about the flow.
      digits: decimal digits of the series.
      bits: precision.
    """
    with precision(bits):
        centre = [*numbers]
        for i in system.unknowns:
            centre[i] = numbers[i].mid()
        with contextlib.suppress(NotEnclosed):
            slopes = enclosing_tube(system, centre, numbers, digits, bits, digits).slopes
        return _of(system, numbers, slopes, known)


def _of(system: ClosingEquations, numbers: list, slopes: arb_mat, known: Structure) -> Spectrum:
    try:
        matrix = system.monodromy(slopes, numbers)
        trivial = Prescribed([], [], [])
        if system.drive is None:
            trivial = prescribe(system, numbers, known)
        matrix = multipliers.reduce(matrix, trivial.rows, trivial.directions)
        values = multipliers.roots(matrix.charpoly().coeffs())
    except (ArithmeticError, np.linalg.LinAlgError):  # no inverse, or no bounds
        return Spectrum([], "undecided")
    values = multipliers.sorted_roots(values)
    if len(values) != matrix.nrows():
        return Spectrum([], "undecided")
    paired = known.form is not None or system.reversals is not None
    conservative = bool(known.integrals) or paired
    return Spectrum(values, _verdict(values, trivial.multipliers, conservative, paired))


def _verdict(values: list[acb], known: list[acb], conservative: bool, paired: bool) -> str:
    if not values:  # all are prescribed
        return "stable"
    sizes = [z.abs_lower() for z in values]
    if any(bool(size > 1) for size in sizes):
        return "unstable"
    if not conservative and all(bool(z.abs_upper() < 1) for z in values):
        return "stable"
    if paired and all(_on_circle(i, values, known) for i in range(len(values))):
        return "stable"
    return "undecided"


def _on_circle(i: int, values: list[acb], known: list[acb]) -> bool:
    z = values[i]
    reflected = 1 / z.conjugate()
    return not any(z.overlaps(one) or z.overlaps(one.conjugate()) for one in known) and all(
        j == i or not reflected.overlaps(other) for j, other in enumerate(values)
    )
