"""What a proof needs to know exactly: that integrals are conserved and symmetries are symmetries.

All are identities between the formulas of a rate, proved by algebra
(`jaxdyn/ball_arithmetic/identities.py`), not tested at points.

A rate may have another case where two quantities are exactly equal, such as a distance and 0. The
discs about the steps of a tube prove that they differ all along its motions (see
`ball_arithmetic.arithmetic`); identities of symmetries also need that the symmetry keeps the
differences, up to their order.
"""

import dataclasses

import numpy as np

from jaxdyn.ball_arithmetic.derivative import gradients
from jaxdyn.ball_arithmetic.field import BallField
from jaxdyn.ball_arithmetic.identities import NoPolynomial, Polynomials
from jaxdyn.ball_arithmetic.program import Program
from jaxdyn.solvers.formulas.formulas import Formulas
from jaxdyn.solvers.formulas.graph import Number
from orbits.proof.closing_equations import ClosingEquations


@dataclasses.dataclass(eq=False)
class Theorems:
    """The rate and functions of the state as polynomials.

    Attributes:
      formulas: the formulas of the rate.
      ring: the ring of polynomials.
      rate: (k) the rate.
      differences: formulas that are not 0 along the motions.
    """

    formulas: Formulas
    ring: Polynomials
    rate: list
    differences: list[Number]
    _program: Program

    @classmethod
    def of(cls, formulas: Formulas, field: BallField | None = None) -> "Theorems":
        """The polynomials of a rate.

        Args:
          formulas: the formulas of the rate, and of others in the same graph.
          field: the rate whose motions are enclosed by tubes, which decide its cases.

        Raises:
          NoPolynomial: the rate is not representable.
        """
        cases = field.cases if field else []
        ring = Polynomials([formulas.time, *formulas.states], frozenset(cases))
        differences = [formulas.graph.sub(*case.args) for case in cases]
        program = Program.of(formulas.graph, list(formulas.rates))
        rate = ring.values(program, ring.generators[: 1 + len(formulas.states)])
        return cls(formulas, ring, rate, differences, program)

    def _variables(self) -> list:
        return list(self.ring.generators[: 1 + len(self.rate)])

    def evaluate(self, results: list[Number], variables: list | None = None) -> list:
        """Formulas of the same graph as polynomials."""
        program = Program.of(self.formulas.graph, results)
        return self.ring.values(program, variables or self._variables())

    def gradient(self, integral: Number) -> list:
        """(k) the gradient of an integral."""
        return self.evaluate(gradients(self.formulas.graph, [integral], self.formulas.states)[0])

    def depends_on_time(self) -> bool:
        """Whether time occurs in the rate."""
        operands = (a for node in self._program.nodes for a in node.args)
        return any(x is self.formulas.time for x in (*self.formulas.rates, *operands))

    def is_conserved(self, integral: Number) -> bool:
        """Whether grad I . f = 0, and I does not depend explicitly on time."""
        graph, time = self.formulas.graph, self.formulas.time
        (by_time,) = self.evaluate(gradients(graph, [integral], [time])[0])
        return self.ring.vanishes(by_time) and self.vanishes_along(
            self.gradient(integral), self.rate
        )

    def is_constant_along(self, integral: Number, direction: list) -> bool:
        """Whether grad I is orthogonal to a direction."""
        return self.vanishes_along(self.gradient(integral), direction)

    def are_turned(self, a: Number, b: Number, direction: list) -> bool:
        """Whether a direction turns functions into each other: a' = b, b' = -a, or the reverse."""
        changes = [self._dot(self.gradient(one), direction) for one in (a, b)]
        here = self.evaluate([a, b])
        return any(
            self.ring.vanishes(changes[0] - sign * here[1])
            and self.ring.vanishes(changes[1] + sign * here[0])
            for sign in (1, -1)
        )

    def is_zero(self, row: list, column: list, zeros: list) -> bool:
        """Whether a product of two vectors is 0, or up to sign a polynomial known to be 0 there."""
        total = self._dot(row, column)
        each = (total, *(total - sign * zero for zero in zeros for sign in (1, -1)))
        return any(self.ring.vanishes(one) for one in each)

    def vanishes_along(self, row: list, column: list) -> bool:
        """Whether a product of two vectors is 0."""
        return self.ring.vanishes(self._dot(row, column))

    def _dot(self, row: list, column: list):
        total = self.ring.constant(0)
        for a, b in zip(row, column, strict=True):
            total += a * b
        return total

    def returns_to_zero(self, row: list, column: list, turn: np.ndarray | None) -> bool:
        """Whether a product of two vectors is a . dy/dt with constant a.

        If it is constant along motions, it is then 0 on every periodic motion; on a motion that
        returns rotated, only entries of y may be involved that the rotation's generator `turn`
        keeps.
        """
        total = self._dot(row, column)
        kept = [True] * len(self.rate) if turn is None else (~turn.any(axis=1)).tolist()
        rates = (rate for rate, one in zip(self.rate, kept, strict=True) if one)
        moving = {str(rate) for rate in rates if rate.total_degree() == 1 and len(rate) == 1}
        names = {str(self.ring.generators[i]) for i in range(1 + len(self.rate))}
        parts = [self.ring.context.from_dict({m: 1}) for m in total.to_dict()]
        return all(str(part) in moving and str(part) in names for part in parts)

    def is_symmetry(self, matrix: np.ndarray, sign: int) -> bool:
        """Whether f(g y) = sign g f(y)."""
        time, *y = self._variables()
        moved = [time, *self.apply(matrix, y)]
        there = self.ring.values(self._program, moved)
        here = self.apply(matrix, self.rate)
        apart = self.evaluate(self.differences)
        if not all(p in apart or -p in apart for p in self.evaluate(self.differences, moved)):
            return False
        return all(self.ring.vanishes(a - sign * b) for a, b in zip(there, here, strict=True))

    def is_generator(self, matrix: np.ndarray, offset: np.ndarray) -> bool:
        """Whether the flow of y' = A y + b consists of symmetries: Df (A y + b) = A f."""
        graph, states = self.formulas.graph, self.formulas.states
        table = gradients(graph, list(self.formulas.rates), states)
        moved = self.direction(matrix, offset)
        wanted = self.apply(matrix, self.rate)
        flat = self.evaluate([s for row in table for s in row])
        k = len(self.rate)
        rows = [flat[i * k : (i + 1) * k] for i in range(k)]
        if not all(self.vanishes_along(self.gradient(d), moved) for d in self.differences):
            return False
        return all(
            self.ring.vanishes(self._dot(row, moved) - one)
            for row, one in zip(rows, wanted, strict=True)
        )

    def keeps(self, form: np.ndarray) -> bool:
        """Whether the flow keeps a constant form J: (Df)^T J + J Df = 0."""
        graph, states, k = self.formulas.graph, self.formulas.states, len(self.rate)
        table = gradients(graph, list(self.formulas.rates), states)
        flat = self.evaluate([s for row in table for s in row])
        columns = [flat[j::k] for j in range(k)]
        # Row i of (Df)^T J is column i of Df times J.
        first = [self.apply(form.T, column) for column in columns]
        return all(
            self.ring.vanishes(first[i][j] - first[j][i]) for i in range(k) for j in range(i)
        )

    def direction(self, matrix: np.ndarray, offset: np.ndarray) -> list:
        """(k) the direction A y + b."""
        linear = self.apply(matrix, self._variables()[1:])
        return [a + self.ring.constant(float(b)) for a, b in zip(linear, offset, strict=True)]

    def changes_by(self, integral: Number, matrix: np.ndarray, sign: int) -> bool:
        """Whether I(g y) = sign I(y)."""
        time, *y = self._variables()
        (there,) = self.evaluate([integral], [time, *self.apply(matrix, y)])
        (here,) = self.evaluate([integral])
        return self.ring.vanishes(there - sign * here)

    def apply(self, matrix: np.ndarray, vector: list) -> list:
        """A matrix of numbers times a vector of polynomials."""
        found = []
        for row in matrix:
            total = self.ring.constant(0)
            for entry, x in zip(row, vector, strict=True):
                if entry:
                    total += self.ring.constant(entry) * x
            found.append(total)
        return found


def missing(system: ClosingEquations) -> str:
    """What the step from a zero of the closing equations to an orbit lacks; "" if nothing.

    See `closing_equations` for why the spared equations hold, and the closing condition for why the
    motion repeats.
    """
    try:
        known = Theorems.of(system.formulas, system.field)
        if system.drive is None and known.depends_on_time():
            return "that the rate is the same at all times, or has the orbit's period"
        for name, integral in system.integrals.items():
            if not known.is_conserved(integral):
                return f"that the {name} is conserved: its rate of change does not simplify to 0"
        return (
            _of_return(system, known) if system.reversals is None else _of_reversal(system, known)
        )
    except NoPolynomial as error:
        return f"an identity of formulas with {error}"


def _of_return(system: ClosingEquations, known: Theorems) -> str:
    goal, parts = system.goal, system.parts
    unit = np.eye(len(goal), dtype=int)
    if system.drive is not None and parts != 1:
        return "that a driven motion repeats after a part of its period"
    if (goal != unit).any():
        if not known.is_symmetry(goal, 1):
            return "that the symmetry of the closing condition is one of the rate"
        if (np.linalg.matrix_power(goal, parts) != unit).any():
            return "that the symmetry's power is the identity"
    if system.generator is not None:
        if not known.is_generator(system.generator, np.zeros(len(goal))):
            return "that the rotation of the closing condition is a symmetry of the rate"
        if (system.generator @ goal != goal @ system.generator).any():
            return "that the rotation commutes with the symmetry"
    for name, integral in system.integrals.items():
        if not known.changes_by(integral, goal, 1):
            return f"that the symmetry keeps the {name}"
        if system.generator is not None:
            turned = known.direction(system.generator, np.zeros(len(goal)))
            if not known.vanishes_along(known.gradient(integral), turned):
                return f"that the rotation keeps the {name}"
    return ""


def _of_reversal(system: ClosingEquations, known: Theorems) -> str:
    if system.drive is not None:
        return "that a driven motion retraces its path"
    assert system.reversals is not None
    here, there = system.reversals
    for matrix in (here, there):
        if (matrix @ matrix != np.eye(len(matrix), dtype=int)).any():
            return "that the reversal of the closing condition is of order 2"
        if not known.is_symmetry(matrix, -1):
            return "that the reversal of the closing condition is one of the rate"
        for name, integral in system.integrals.items():
            if not known.changes_by(integral, matrix, -1):
                return f"that the {name} is 0 where the motion meets the fixed sets"
    turned = np.linalg.matrix_power(there @ here, system.parts // 2)
    if system.parts % 2 or (turned != np.eye(len(here), dtype=int)).any():
        return "that the product of the reversals has that order"
    return ""
