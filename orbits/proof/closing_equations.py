"""The closing equations of an orbit as a square system, for any number of digits.

The unknowns are the free entries of the start, the period, and the angle of a relative orbit. For
each direction along which the orbit is not isolated (along the motion, along symmetries, along its
family), an entry of the start (or the period) is held at its value, which is a binary float.
Equations that follow from the others by integrals of the motion are left out, or "spared", one for
each integral. What is left has a regular Jacobian.

The spared equations hold for the following reason. Let the motion go from y0 to y, and let g, the
image of y0 that the closing condition requires, differ from y only in spared entries, by e. For
integrals that both the motion and the symmetry of the closing condition keep, I(y) = I(y0) = I(g),
so that

    0 = I_i(y) - I_i(g) = sum_j N_ij e_j

with N_ij between bounds of dI_i/dy_j on the hull of y and g (mean value theorem, row by row). If
all such matrices N are regular, e = 0. With a reversal R, which maps I to -I, the motion starts at
a fixed point, where I = 0, and ends at y; g = (y + R y) / 2 is a fixed point, where I = 0 as well,
and the same follows. The alternative, to unfold the rate by forces lambda_i grad I_i (Munoz-Almaraz
et al. 2003, Physica D 181, 1; Galan et al. 2002, Physical Review Letters 88, 241101, on the eight),
makes formulas three times as long.
"""

import dataclasses

import numpy as np

from jaxdyn.ball_arithmetic.arithmetic import COMPLEX, REAL, arb, arb_mat, column, midpoints
from jaxdyn.ball_arithmetic.derivative import gradients
from jaxdyn.ball_arithmetic.field import BallField
from jaxdyn.ball_arithmetic.motion import End, follow
from jaxdyn.ball_arithmetic.program import Program
from jaxdyn.solvers.formulas.formulas import Formulas
from jaxdyn.solvers.formulas.graph import Number


@dataclasses.dataclass(frozen=True)
class ClosingEquations:
    """The square system of an orbit.

    Attributes:
      field: the rate.
      formulas: the formulas of the rate.
      integrals: the formula of each integral by which equations are spared, by name.
      parts: number of parts in a period.
      embed: (k, p) the start as a function of its free entries; entries 0, 1 and -1.
      end: (m, k) matrix E of the closing error E y - G y0, from the start y0 and the state y at
        the end of a part; for a relative orbit G y0 is rotated.
      goal: (m, k) matrix G of the closing error.
      generator: (k, k) the generator of the rotation; None unless the orbit is relative.
      names: (p + 1 or p + 2) names of start entries, "period", "angle".
      values: the numbers with these names, in floats, at which the search begins.
      held: indices of the numbers that keep their values.
      spared: indices of the equations that follow from the others, one for each integral.
      sizes: (k,) sizes of the entries of the state along the motion: powers of 2, which do not
        round.
      drive: (w, n) for a driven scene, whose period is 2 pi n / w; else None.
      candidates: formulas that may be integrals.
      reversals: (k, k) the two reversals that fix the start and the end of a part; None for a
        return.
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
    spared: tuple[int, ...]
    sizes: tuple[float, ...]
    drive: tuple[float, int] | None
    candidates: tuple[Number, ...] = ()
    reversals: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def unknowns(self) -> list[int]:
        """Indices of the numbers that are not held."""
        return [i for i in range(len(self.names)) if i not in self.held]

    @property
    def equations(self) -> list[int]:
        """Indices of the closing equations that are not spared."""
        return [i for i in range(len(self.end)) if i not in self.spared]

    @property
    def units(self) -> np.ndarray:
        """(p + 1 or p + 2) units of the numbers.

        They are the sizes of start entries, a radian of the period, and 1 for an angle; all are
        powers of 2.
        """
        p = self.embed.shape[1]
        start = np.where(self.embed.T != 0, self.sizes, 0.0).max(axis=1)
        period = power_of_2(self.values[p] / (2 * np.pi))
        return np.append(np.append(start, period), np.ones(len(self.names) - p - 1))

    @property
    def residual_units(self) -> np.ndarray:
        """(m,) units of the closing error's entries."""
        return np.where(self.end != 0, self.sizes, 0.0).max(axis=1)

    def centre(self) -> list[arb]:
        """All numbers at the start of a search, exactly."""
        numbers = [arb(x) for x in self.values]
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

    def goals(self, numbers: list) -> tuple[list, list | None]:
        """(m) the wanted image of the end, and its derivative with respect to the angle."""
        goal = product(self.goal, self.start(numbers))
        if self.generator is None:
            return goal, None
        turned = self._rotation(numbers) * column(goal)
        return turned.entries(), (_matrix(self.generator) * turned).entries()

    def turn_angle(self, numbers: list) -> arb | None:
        """() the angle of a relative orbit over its period; None for other orbits."""
        return None if self.generator is None else numbers[len(self.names) - 1] * self.parts

    def _rotation(self, numbers: list) -> arb_mat:
        return (_matrix(self.generator) * numbers[len(self.names) - 1]).exp()

    def residual(self, end: list, numbers: list) -> list:
        """(m) the closing error of a part that leads to an end, spared equations included."""
        goal, _ = self.goals(numbers)
        return [a - b for a, b in zip(product(self.end, end), goal, strict=True)]

    def unspared(self, residual: list) -> list:
        """Those entries of a closing error that are not spared."""
        return [residual[i] for i in self.equations]

    def jacobian(self, end: list, slopes: arb_mat, numbers: list) -> arb_mat:
        """(m, m) Jacobian of the closing error in the unknowns, without spared equations."""
        embed, ends, goal = map(_matrix, (self.embed, self.end, self.goal))
        by_start = ends * slopes * embed
        back = goal * embed if self.generator is None else self._rotation(numbers) * goal * embed
        rate = self.field.rate(self._end_time(numbers), end)
        columns = (by_start - back).transpose().tolist()
        columns.append([x / self.parts for x in product(self.end, rate)])
        turning = self.goals(numbers)[1]
        if turning is not None:
            columns.append([-x for x in turning])
        return arb_mat([[columns[i][j] for i in self.unknowns] for j in self.equations])

    def spared_hold(self, end: list, numbers: list) -> bool:
        """Whether the spared equations are proved to follow from the others, for boxes.

        Raises:
          Undecided: it is not decided which case of an integral's formula holds there.
        """
        if not self.integrals:
            return True
        hull = [a.union(b) for a, b in zip(end, self._nearest(end, numbers), strict=True)]
        spread = self.spread()[:, list(self.spared)]
        # Complex functions have no case that holds only at one point.
        rows = self.gradients(list(self.integrals.values()), hull, COMPLEX)
        matrix = arb_mat(rows) * _matrix(spread)
        return bool(abs(matrix.det()) > 0)

    def _nearest(self, end: list, numbers: list) -> list:
        """(k) the point whose difference from the end is the closing error."""
        if self.reversals is None:
            return self.goals(numbers)[0]
        image = product(self.reversals[1], end)
        return [(a + b) / 2 for a, b in zip(end, image, strict=True)]

    def inverse(self, jacobian: arb_mat) -> arb_mat:
        """The inverse of Newton's Jacobian, computed in the units of unknowns and equations.

        Raises:
          ZeroDivisionError: it may be singular.
        """
        own, rows = self.units[self.unknowns].tolist(), self.residual_units[self.equations].tolist()
        scaled = [
            [x * unit / row for x, unit in zip(entries, own, strict=True)]
            for entries, row in zip(jacobian.tolist(), rows, strict=True)
        ]
        found = arb_mat(scaled).inv().tolist()
        return arb_mat(
            [
                [x * unit / row for x, row in zip(entries, rows, strict=True)]
                for entries, unit in zip(found, own, strict=True)
            ]
        )

    def spread(self) -> np.ndarray:
        """(k, m) the map from the closing error to the end minus its `_nearest` point.

        For a reversal it is known up to factors: a pair of entries that are exchanged has one
        equation.
        """
        return np.eye(self.field.k, dtype=int) if self.reversals is None else self.end.T

    def monodromy(self, slopes: arb_mat, numbers: list) -> arb_mat:
        """(k, k) the monodromy matrix over the period, from the derivative over a part of it."""
        if self.reversals is not None:
            here, there = map(_matrix, self.reversals)
            return (here * inverse(slopes) * there * slopes) ** (self.parts // 2)
        return (self.back(numbers) * slopes) ** self.parts

    def back(self, numbers: list) -> arb_mat:
        """(k, k) the inverse of the closing symmetry, with the rotation of a relative orbit."""
        goal = _matrix(self.goal)
        return (goal if self.generator is None else self._rotation(numbers) * goal).inv()

    def gradients(self, integrals: list[Number], y: list, functions=REAL) -> list[list]:
        """(n, k) gradients of integrals at a state."""
        graph, states = self.formulas.graph, self.formulas.states
        rows = gradients(graph, integrals, states)
        program = Program.of(graph, [s for row in rows for s in row])
        inputs = {self.formulas.time: arb(0), **dict(zip(states, y, strict=True))}
        flat, k = program(inputs, functions), len(states)
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
            span,
            digits,
            slopes=slopes,
            more_order=more,
        )


def power_of_2(x):
    """The power of 2 nearest to positive numbers."""
    return np.exp2(np.round(np.log2(x)))


def product(matrix: np.ndarray, vector: list) -> list:
    """A matrix of known numbers times a vector of balls; factors of 1 and -1 cause no rounding."""
    found = []
    for row in matrix.tolist():
        total = None
        for entry, x in zip(row, vector, strict=True):
            if entry:
                part = x if entry == 1 else -x if entry == -1 else entry * x
                total = part if total is None else total + part
        found.append(arb(0) if total is None else total)
    return found


def inverse(matrix: arb_mat) -> arb_mat:
    """The inverse of a matrix, preconditioned: elimination far from the identity widens balls."""
    near = midpoints(midpoints(matrix).inv())
    return near * (matrix * near).inv()


def _matrix(table: np.ndarray) -> arb_mat:
    return arb_mat(table.tolist())
