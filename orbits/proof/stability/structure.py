"""What the flow about an orbit is proved to conserve, and the multipliers that this prescribes.

Let W be gradients w_i of integrals at the start, independent, and g_j independent directions in
their common kernel. If the monodromy matrix M takes the span of the w_i to itself from the right,
and that of the g_j from the left, it acts on the kernel modulo the g_j, and the multipliers are
those of this action, of that on the w_i and of that on the g_j. Here the directions are

    the flow f, if the rate does not depend on time;
    A y + b for a linear symmetry, if its flow commutes with that of the rate;
    J^-1 w_i, if the flow keeps a constant symplectic form J (Noether's theorem; Arnold 1989,
    Mathematical Methods of Classical Mechanics, section 40): M J^-1 M^T = J^-1.

For an orbit that returns, w_i M = w_i and M g_j = g_j, and all these multipliers are 1. For a
relative orbit M is R^-1 times the derivative of the flow, with a rotation R by the angle a; then an
integral that R keeps prescribes a 1, and so does a direction that commutes with R. Two integrals
that R turns into each other, such as the entries of the momentum, or their two directions,
prescribe exp(i a) and exp(-i a). Such integrals are 0 on the orbit, unless exp(i a) = 1, since they
are conserved.
"""

import dataclasses
import itertools
import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from flint import fmpq, fmpq_mat

from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.analysis.monodromy import WEIGHTS, invariant_forms
from jaxdyn.ball_arithmetic.arithmetic import acb, arb, arb_mat, precision
from jaxdyn.ball_arithmetic.identities import NoPolynomial
from jaxdyn.solvers.formulas.graph import Number
from orbits.proof.closing_equations import ClosingEquations, product
from orbits.proof.posing import pivots, points_near
from orbits.proof.theorems import Theorems


@dataclasses.dataclass(frozen=True)
class Structure:
    """What is known about the flow besides the rate.

    Attributes:
      theorems: the rate as polynomials; None if it is not representable, and nothing is known.
      integrals: conserved functions by name, invariant under the rotation of a relative orbit.
      pairs: pairs of conserved functions that this rotation turns into each other.
      generators: (matrix, offset) of symmetries, besides the flow, that commute with the rotation.
      form: (k, k) constant symplectic form, in fractions, invariant under the flow and the
        rotation; None if none is proved.
    """

    theorems: Theorems | None = None
    integrals: dict[str, Number] = dataclasses.field(default_factory=dict)
    pairs: tuple[tuple[Number, Number], ...] = ()
    generators: tuple[tuple[np.ndarray, np.ndarray], ...] = ()
    form: np.ndarray | None = None


class Prescribed(NamedTuple):
    """The vectors that prescribe multipliers.

    Attributes:
      rows: (n) independent gradients (k) whose span the monodromy matrix leaves invariant.
      directions: (m) independent directions (k) in their kernel whose span it leaves invariant.
      multipliers: the distinct multipliers that these prescribe, in the upper half plane.
    """

    rows: list[list]
    directions: list[list]
    multipliers: list[acb]


class _Direction(NamedTuple):
    """A direction at the start, and the same direction as polynomials of the state."""

    at_start: list
    everywhere: list


def structure(
    system: ClosingEquations, candidates: dict[str, Number], generators: list, forms: list
) -> Structure:
    """What is proved among candidates: integrals, generators of symmetries, symplectic forms."""
    try:
        theorems = Theorems.of(system.formulas, system.field)
    except NoPolynomial:
        return Structure()
    turn = np.zeros((len(theorems.rate),) * 2) if system.generator is None else system.generator
    turned = theorems.direction(turn, np.zeros(len(turn)))
    conserved = {n: i for n, i in candidates.items() if _holds(theorems.is_conserved, i)}
    kept = {n: i for n, i in conserved.items() if _holds(theorems.is_constant_along, i, turned)}
    rest = [i for n, i in conserved.items() if n not in kept]
    symmetries = (
        pair
        for pair in generators
        if _commutes(turn, *pair) and _holds(theorems.is_generator, *pair)
    )
    return Structure(
        theorems=theorems,
        integrals=kept,
        pairs=tuple(_pairs(theorems, rest, turned)),
        generators=tuple(symmetries),
        form=next((exact(form) for form in forms if _is_kept(theorems, form, turn)), None),
    )


def _holds(claim, *args) -> bool:
    """Whether a claim is proved; a claim about formulas that are not polynomials is not."""
    try:
        return claim(*args)
    except NoPolynomial:
        return False


def _pairs(theorems: Theorems, integrals: list[Number], turned: list):
    """Pairs of integrals that a rotation turns into each other at unit rate."""
    left = list(integrals)
    while left:
        a = left.pop(0)
        for b in left:
            if _holds(theorems.are_turned, a, b, turned):
                left.remove(b)
                yield a, b
                break


def prescribe(system: ClosingEquations, numbers: list, known: Structure) -> Prescribed:
    """The vectors that are proved to prescribe multipliers, for a rate that is autonomous."""
    start = system.start(numbers)
    flow = [arb(x) for x in system.field.rate(arb(0), start)]
    if known.theorems is None:
        return Prescribed([], [flow], [acb(1)])
    angle = system.turn_angle(numbers)
    turning = angle is not None and bool(angle.cos() < 1)
    groups = [(one,) for one in known.integrals.values()] + list(known.pairs if turning else ())
    slopes = [system.gradients(list(group), start) for group in groups]
    chosen = _independent(slopes)
    rows = [[known.theorems.gradient(one) for one in groups[i]] for i in chosen]
    zeros = [one for i in chosen for one in groups[i] if len(groups[i]) > 1]
    candidates = [[_linear(known.theorems, *one, start)] for one in known.generators]
    if known.form is not None:
        inverse = _inverse(known.form)
        for i, group in zip(chosen, rows, strict=True):
            pairs = zip(slopes[i], group, strict=True)
            candidates.append(
                [
                    _Direction(product(inverse, x), known.theorems.apply(inverse, p))
                    for x, p in pairs
                ]
            )
    inside = [
        group
        for group in candidates
        if all(_in_kernel(system, known.theorems, rows, one, zeros) for one in group)
    ]
    found = [[flow], *([one.at_start for one in group] for group in inside)]
    ones = [acb(1), acb(angle.cos(), abs(angle.sin()))] if angle is not None else [acb(1)]
    return Prescribed(
        rows=[row for i in chosen for row in slopes[i]],
        directions=[one for i in _independent(found) for one in found[i]],
        multipliers=ones,
    )


def _linear(theorems: Theorems, matrix: np.ndarray, offset: np.ndarray, start: list) -> _Direction:
    """The direction A y + b."""
    moved = product(matrix, start)
    there = [x + arb(float(b)) for x, b in zip(moved, offset, strict=True)]
    return _Direction(there, theorems.direction(matrix, offset))


def _in_kernel(
    system: ClosingEquations,
    theorems: Theorems,
    rows: list[list],
    direction: _Direction,
    zeros: list[Number],
) -> bool:
    """Whether the derivatives of integrals along a direction are 0 on the orbit.

    These derivatives are conserved, since the direction's flow commutes with that of the rate.
    """
    known = theorems.evaluate(zeros)
    return all(
        theorems.is_zero(row, direction.everywhere, known)
        or theorems.returns_to_zero(row, direction.everywhere, system.generator)
        for group in rows
        for row in group
    )


def _independent(groups: list[list[list]]) -> list[int]:
    """Indices of groups of vectors that are proved to be independent, chosen in order."""
    chosen: list[int] = []
    for i in range(len(groups)):
        rows = [row for j in (*chosen, i) for row in groups[j]]
        matrix = arb_mat(rows)
        if bool((matrix * matrix.transpose()).det() > 0):  # Gram's determinant
            chosen.append(i)
    return chosen


def _commutes(turn: np.ndarray, matrix: np.ndarray, offset: np.ndarray) -> bool:
    """Whether the flow of y' = A y + b commutes with a rotation."""
    turn, matrix, offset = map(exact, (turn, matrix, offset))
    return bool((turn @ matrix == matrix @ turn).all() and (turn @ offset == 0).all())


def _is_kept(theorems: Theorems, form: np.ndarray, turn: np.ndarray) -> bool:
    """Whether a form is regular, antisymmetric, and invariant under the flow and a rotation."""
    form, turn = exact(form), exact(turn)
    regular = (form.T == -form).all() and _rational(form).det() != 0
    return (
        bool(regular)
        and bool((turn.T @ form + form @ turn == 0).all())
        and _holds(theorems.keeps, form)
    )


def _inverse(form: np.ndarray) -> np.ndarray:
    """(k, k) a multiple of the inverse of a form whose entries are whole numbers."""
    found = _rational(form).inv()
    table = [[Fraction(int(x.p), int(x.q)) for x in row] for row in found.tolist()]
    scale = math.lcm(*(x.denominator for row in table for x in row))
    return np.array([[int(x * scale) for x in row] for row in table], object)


def _rational(form: np.ndarray) -> fmpq_mat:
    return fmpq_mat([[fmpq(x.numerator, x.denominator) for x in row] for row in form.tolist()])


def exact(table: np.ndarray) -> np.ndarray:
    """An array of numbers as an array of fractions, whose products are exact."""
    found = np.empty(np.shape(table), object)
    found.flat = [Fraction(x) for x in np.asarray(table).ravel().tolist()]
    return found


# ---- Constant symplectic forms that a rate may keep, found in floats, to be proved
#
# Forms of `invariant_forms` are recognised if their entries are simple rational multiples of one of
# them, as with masses 1/2 and 3/2, where all coordinates have one unit and all velocities one.

_POINTS = 6
_SPREAD = 0.3  # spread of the points, relative to each entry's size
_LARGEST = 1000  # largest denominator
_ROUNDED = 1e-8  # largest difference of an entry from its fraction
_BITS = 128


def forms_of(system: ClosingEquations) -> list[np.ndarray]:
    """(k, k) candidates for a symplectic form, whose entries are fractions; [] if none is found."""
    k = system.field.k
    if k % 2:
        return []
    slopes, each = _slopes(system), np.array(system.sizes)
    if system.generator is not None:
        slopes.append(system.generator.astype(float))
    if not slopes:
        return []
    above = np.triu_indices(k, 1)
    # Forms are found for entries scaled by their sizes, and recognised for unscaled ones.
    null = np.array(
        [form[above] for form in invariant_forms([map_in_units(x, each) for x in slopes])]
    )
    chosen = pivots(null, len(null)) if len(null) else None
    if chosen is None:
        return []
    null = null / np.outer(each, each)[above]
    basis = _as_fractions(np.linalg.solve(null[:, chosen].T, null).tolist())
    if basis is None:
        return []
    found = []
    for weights in WEIGHTS[: 1 if len(basis) == 1 else None]:
        total = np.full((k, k), Fraction(0), object)
        for weight, row in zip(itertools.cycle(weights), basis, strict=False):
            for (i, j), x in zip(np.transpose(above), row, strict=True):
                total[i, j] += weight * x
                total[j, i] -= weight * x
        found.append(total)
    return found


def _slopes(system: ClosingEquations) -> list[np.ndarray]:
    """(k, k) derivatives of the rate at points near the orbit."""
    k, found = system.field.k, []
    with precision(_BITS):
        for t, y in points_near(system, _SPREAD, _POINTS):
            try:
                flat = system.field.slopes(system.field.inputs(arb(t), y))[k:]
            except ArithmeticError:
                continue
            table = np.array([float(x) for x in flat]).reshape(k, k)
            if np.isfinite(table).all():
                found.append(table)
    return found


def _as_fractions(rows: list[list[float]]) -> list[list[Fraction]] | None:
    """The same numbers as fractions; None if one is not near a simple one."""
    found = [[Fraction(x).limit_denominator(_LARGEST) for x in row] for row in rows]
    pairs = zip(itertools.chain(*rows), itertools.chain(*found), strict=True)
    near = all(math.isclose(x, y, rel_tol=0.0, abs_tol=_ROUNDED) for x, y in pairs)
    return found if near else None
