"""Linear stability as a theorem: enclosures of the multipliers that are not 1 by the theory.

How many are 1: let I_1, ... be conserved with independent gradients w_i at the start, and g_1, ...
independent generators of symmetries (the flow among them) with w_i . g_j = 0. The monodromy matrix
M keeps each w_i (w_i M = w_i) and each g_j, so it is the identity on the quotient by the common
kernel of the w_i, and on the span of the g_j inside that kernel: at least n + m multipliers are 1.
M of a relative orbit is R^-1 times the derivative of the flow, with a rotation R: then only those
I_i count that R keeps, and only those g_j whose symmetries commute with R.

On the unit circle: if M is symplectic, or similar to its inverse by a reversal of the orbit, with a
multiplier z there is 1 / conj z, as often; 1 is its own image, so that is true of the others alone.
If each enclosure of a multiplier holds one, and its image under that reflection meets no other
enclosure, z = 1 / conj z, that is |z| = 1; multipliers on the circle that are distinct, and
distinct from 1, mean linear stability (Kapela, Simo 2007, Nonlinearity 20, 1241).
"""

import dataclasses
from fractions import Fraction

import numpy as np

from jaxdyn.balls.arithmetic import acb, arb, arb_mat, precision
from jaxdyn.balls.identities import NoPolynomial
from jaxdyn.balls.tube import NotEnclosed
from orbits.proof import multipliers
from orbits.proof.closing_equations import ClosingEquations, product
from orbits.proof.krawczyk import enclosed
from orbits.proof.theorems import Theorems


@dataclasses.dataclass(frozen=True)
class Spectrum:
    """The non-trivial multipliers.

    Attributes:
      values: enclosures, one for each; empty if they cannot be told apart.
      verdict: "stable", "unstable" or "undecided".
    """

    values: list[acb]
    verdict: str


@dataclasses.dataclass(frozen=True)
class Structure:
    """What is known of the flow beside the rate.

    Attributes:
      integrals: conserved functions by name, which the rotation of a relative orbit keeps.
      form: (k, k) constant symplectic form that the flow keeps; None if none is proved.
      generators: (matrix, offset) of symmetries, without the flow, that commute with it.
    """

    integrals: dict
    generators: list[tuple[np.ndarray, np.ndarray]]
    form: np.ndarray | None


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
      numbers: enclosures of all its numbers.
      slopes: the derivative over a part of the period, for all motions of a wider box. It is
        enough for an unstable orbit; for others it is enclosed again, for sharper multipliers.
      known: about the flow.
      digits: of the series.
      bits: precision.
    """
    with precision(bits):
        rough = _of(system, numbers, slopes, known)
        if rough.verdict == "unstable":
            return rough
        centre = [*numbers]
        for i in system.unknowns:
            centre[i] = numbers[i].mid()
        try:
            found = enclosed(system, centre, numbers, digits, bits, digits)
        except NotEnclosed:
            return rough
        return _of(system, numbers, found.slopes, known)


def _of(system: ClosingEquations, numbers: list, slopes: arb_mat, known: Structure) -> Spectrum:
    try:
        matrix = system.monodromy(slopes, numbers)
        unit = 0 if system.drive is not None else _unit(system, numbers, known)
        values = multipliers.roots(multipliers.deflated(matrix, unit))
    except ArithmeticError:  # no inverse, or no bounds
        return Spectrum([], "undecided")
    values = multipliers.sorted_roots(values)
    if len(values) != system.field.k - unit:
        return Spectrum([], "undecided")
    paired = known.form is not None or system.reversals is not None
    return Spectrum(values, _verdict(values, bool(known.integrals) or paired, paired))


def _verdict(values: list[acb], conservative: bool, paired: bool) -> str:
    sizes = [z.abs_lower() for z in values]
    if any(bool(size > 1) for size in sizes):
        return "unstable"
    if not conservative and all(bool(z.abs_upper() < 1) for z in values):
        return "stable"
    if paired and all(_on_circle(i, values) for i in range(len(values))):
        return "stable"
    return "undecided"


def _on_circle(i: int, values: list[acb]) -> bool:
    reflected = 1 / values[i].conjugate()
    return not values[i].overlaps(acb(1)) and all(
        j == i or not reflected.overlaps(z) for j, z in enumerate(values)
    )


def _unit(system: ClosingEquations, numbers: list, known: Structure) -> int:
    """A number of multipliers that are 1, proved."""
    start = system.start(numbers)
    flow = [arb(x) for x in system.field.rate(arb(0), start)]
    if not known.integrals:
        return int(_rank([flow]))
    theorems = Theorems.of(system.formulas, system.field)
    rows = [theorems.gradient(integral) for integral in known.integrals.values()]
    values = system.gradients(list(known.integrals.values()), start)
    chosen = _independent(values)
    directions = []
    for matrix, offset in known.generators:
        direction = theorems.direction(matrix, offset)
        if all(
            theorems.vanishes_along(rows[i], direction)
            or (system.generator is None and theorems.returns_to_zero(rows[i], direction))
            for i in chosen
        ):
            moved = product(matrix, start)
            directions.append([x + arb(float(b)) for x, b in zip(moved, offset, strict=True)])
    return len(chosen) + len(_independent([flow, *directions]))


def _independent(vectors: list[list]) -> list[int]:
    """Indices of vectors that are proved to be linearly independent, as many as come first."""
    chosen: list[int] = []
    for i in range(len(vectors)):
        if _rank([vectors[j] for j in (*chosen, i)]):
            chosen.append(i)
    return chosen


def _rank(rows: list[list]) -> bool:
    """Whether rows are proved to be independent: their Gram determinant is not 0."""
    matrix = arb_mat(rows)
    determinant = (matrix * matrix.transpose()).det()
    return bool(determinant > 0)


def structure(system: ClosingEquations, candidates: dict, generators: list, form) -> Structure:
    """What is proved among candidates: integrals, generators of symmetries, a symplectic form."""
    try:
        theorems = Theorems.of(system.formulas, system.field)
        turn = np.zeros((len(theorems.rate),) * 2) if system.generator is None else system.generator
        turned = theorems.direction(turn, np.zeros(len(turn)))
        integrals = {
            n: i
            for n, i in candidates.items()
            if theorems.is_conserved(i) and theorems.vanishes_along(theorems.gradient(i), turned)
        }
        symmetries = [
            pair for pair in generators if _commutes(turn, *pair) and theorems.is_generator(*pair)
        ]
        kept = form if _is_kept(theorems, form, turn) else None
        return Structure(integrals, symmetries, kept)
    except NoPolynomial:
        return Structure({}, [], None)


def _commutes(turn: np.ndarray, matrix: np.ndarray, offset: np.ndarray) -> bool:
    """Whether the flow of y' = A y + b commutes with a rotation."""
    turn, matrix, offset = map(_rational, (turn, matrix, offset))
    return bool((turn @ matrix == matrix @ turn).all() and (turn @ offset == 0).all())


def _is_kept(theorems: Theorems, form, turn: np.ndarray) -> bool:
    """Whether a regular, antisymmetric form is kept by the flow and by a rotation."""
    if form is None or (form.T != -form).any() or not abs(arb_mat(form.tolist()).det()) > 0:
        return False
    exact, turn = _rational(form), _rational(turn)
    return bool((turn.T @ exact + exact @ turn == 0).all()) and theorems.keeps(form)


def _rational(table: np.ndarray) -> np.ndarray:
    """An array of floats as one of fractions, whose products are exact."""
    found = np.empty(table.shape, object)
    found.flat = [Fraction(x) for x in np.asarray(table, float).ravel().tolist()]
    return found
