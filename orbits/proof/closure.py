"""The closing equations of an orbit as a square system, for any number of digits.

Unknown are the free entries of the start, the period, the angle of a relative orbit, and one
parameter lambda_i for each integral I_i that the closing equations depend on; the rate is unfolded
by the forces lambda_i grad I_i. As many entries of the start (or the period) are held at the
values they have, which are binary floats, as there are directions along which the orbit is not
alone: along the motion, along symmetries, along its family. That makes as many equations as
unknowns, with a regular Jacobian (Munoz-Almaraz et al. 2003, Physica D 181, 1; Galan et al. 2002,
Physical Review Letters 88, 241101, on the figure-eight).

Why lambda is 0 at a solution: with L = sum_i lambda_i I_i the unfolded rate is f + grad L, and
grad L . f = 0 as the I_i are integrals of f. So dL/dt = |grad L|^2 >= 0 along the motion. The
motion closes and closing changes no I_i, hence L returns: grad L = 0 all along, and the motion is
one of f itself.
"""

import dataclasses

import numpy as np

from jaxdyn.balls.arithmetic import Program, arb, arb_mat
from jaxdyn.balls.derivative import gradients
from jaxdyn.balls.field import BallField
from jaxdyn.balls.motion import End, follow
from jaxdyn.solvers.taylor.formulas import Formulas
from jaxdyn.solvers.taylor.graph import Number


@dataclasses.dataclass(frozen=True)
class Closure:
    """The square system of an orbit.

    Attributes:
      field: the rate, unfolded.
      formulas: of the rate itself.
      integrals: the formula of each integral in use, by name.
      parts: number of parts in a period.
      embed: (k, p) the start as a function of its free entries; entries 0, 1 and -1.
      end: (m, k) the closing error is ``end`` times the end of a part ...
      goal: (m, k) ... minus ``goal`` times the start, rotated for a relative orbit.
      generator: (k, k) of the rotation; None unless the orbit is relative.
      names: (p + 1 or p + 2) names of start entries, "period", "angle".
      values: floats of the same: where the search begins.
      held: indices of those that keep their values.
      drive: (w, n) of a driven scene, whose period is 2 pi n / w; else None.
      candidates: formulas that may be integrals.
      reversals: (k, k) those that fix the start and the end of a part; None for a return.
    """

    field: BallField
    formulas: Formulas
    integrals: dict[str, Number]
    parts: int
    embed: np.ndarray
    end: np.ndarray
    goal: np.ndarray
    generator: np.ndarray | None
    names: tuple[str, ...]
    values: tuple[float, ...]
    held: tuple[int, ...]
    drive: tuple[float, int] | None
    candidates: tuple[Number, ...] = ()
    reversals: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def unknowns(self) -> list[int]:
        """Indices of what is not held; unfolding parameters come after the named numbers."""
        count = len(self.names) + self.field.n
        return [i for i in range(count) if i not in self.held]

    def centre(self) -> list[arb]:
        """All numbers at the start of a search, exactly; lambda is 0."""
        numbers = [arb(x) for x in self.values] + [arb(0)] * self.field.n
        if self.drive is not None:
            numbers[self.embed.shape[1]] = self.exact_period()
        return numbers

    def exact_period(self) -> arb:
        """The period that the drive prescribes, at the present precision."""
        assert self.drive is not None
        frequency, turns = self.drive
        return 2 * arb.pi() * turns / arb(frequency)

    def start(self, numbers: list) -> list:
        """(k) the start."""
        return product(self.embed, numbers[: self.embed.shape[1]])

    def period(self, numbers: list) -> arb:
        """() the period."""
        return numbers[self.embed.shape[1]]

    def unfolding(self, numbers: list) -> list:
        """(n) lambda."""
        return numbers[len(self.names) :]

    def goals(self, numbers: list) -> tuple[list, list | None]:
        """(m) the wanted image of the end, and its derivative by the angle."""
        goal = product(self.goal, self.start(numbers))
        if self.generator is None:
            return goal, None
        turned = self._rotation(numbers) * _column(goal)
        return turned.entries(), (_matrix(self.generator) * turned).entries()

    def _rotation(self, numbers: list) -> arb_mat:
        return (_matrix(self.generator) * numbers[len(self.names) - 1]).exp()

    def residual(self, end: list, numbers: list) -> list:
        """(m) the closing error of a part that leads to this end."""
        goal, _ = self.goals(numbers)
        return [a - b for a, b in zip(product(self.end, end), goal, strict=True)]

    def jacobian(self, end: list, slopes: arb_mat, numbers: list) -> arb_mat:
        """(m, m) derivative of the closing error by the unknowns."""
        embed, ends, goal = map(_matrix, (self.embed, self.end, self.goal))
        k = self.field.k
        table = slopes.tolist()
        by_start = ends * arb_mat([row[:k] for row in table]) * embed
        back = goal * embed if self.generator is None else self._rotation(numbers) * goal * embed
        rate = self.field.rate(self._end_time(numbers), end, self.unfolding(numbers))
        columns = (by_start - back).transpose().tolist()
        columns.append([x / self.parts for x in product(self.end, rate)])
        turning = self.goals(numbers)[1]
        if turning is not None:
            columns.append([-x for x in turning])
        if self.field.n:
            by_unfolding = ends * arb_mat([row[k:] for row in table])
            columns += by_unfolding.transpose().tolist()
        return arb_mat([columns[i] for i in self.unknowns]).transpose()

    def monodromy(self, numbers: list, digits: float) -> arb_mat:
        """(k, k) the monodromy matrix over the period, to about this many digits; not proved."""
        k = self.field.k
        returns = len(self.end) == k
        parts = self.parts if returns else 1
        span = self.period(numbers) / parts
        at, unfolding = (arb(0), self.start(numbers)), self.unfolding(numbers)
        run = follow(self.field, *at, unfolding, span, digits, slopes=True)
        part = arb_mat([row[:k] for row in _known(run.slopes).tolist()])
        if returns:
            part = self.back(numbers) * part
        return part**parts

    def back(self, numbers: list) -> arb_mat:
        """(k, k) the inverse of the closing symmetry, with the rotation of a relative orbit."""
        goal = _matrix(self.goal)
        return (goal if self.generator is None else self._rotation(numbers) * goal).inv()

    def gradients(self, integrals: list[Number], y: list) -> list[list]:
        """(n, k) gradients of integrals at a state."""
        graph, states = self.formulas.graph, self.formulas.states
        rows = gradients(graph, integrals, states)
        program = Program.of(graph, [s for row in rows for s in row])
        inputs = {self.formulas.time: arb(0), **dict(zip(states, y, strict=True))}
        flat, k = program(inputs), len(states)
        return [flat[i * k : (i + 1) * k] for i in range(len(integrals))]

    def _end_time(self, numbers: list) -> arb:
        return self.period(numbers) / self.parts

    def motion(self, numbers: list, digits: float, *, slopes: bool = False, more: int = 0) -> End:
        """The motion over a part of the period, to about this many digits."""
        span = self.period(numbers) / self.parts
        return follow(
            self.field,
            arb(0),
            self.start(numbers),
            self.unfolding(numbers),
            span,
            digits,
            slopes=slopes,
            more_order=more,
        )


def _known(slopes: arb_mat | None) -> arb_mat:
    assert slopes is not None
    return slopes


def product(matrix: np.ndarray, vector: list) -> list:
    """A matrix of 0, 1 and -1 times a vector of balls, without rounding where it moves entries."""
    found = []
    for row in matrix.tolist():
        total = None
        for entry, x in zip(row, vector, strict=True):
            if entry:
                part = x if entry == 1 else -x if entry == -1 else entry * x
                total = part if total is None else total + part
        found.append(arb(0) if total is None else total)
    return found


def float_matrix(matrix: arb_mat) -> np.ndarray:
    """A matrix in floats."""
    return np.array([[float(x.mid()) for x in row] for row in matrix.tolist()])


def _matrix(table: np.ndarray) -> arb_mat:
    return arb_mat(table.tolist())


def _column(vector: list) -> arb_mat:
    return arb_mat([[x] for x in vector])
