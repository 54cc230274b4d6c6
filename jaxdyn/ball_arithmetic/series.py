"""Taylor coefficients of a motion, and of its derivative with respect to the start, in balls.

Let p be the first n coefficients of a solution of y' = f(y). Then y = p + O(s^n), and since f is
evaluated on series as a whole, f(y) = f(p) + Df(p) (y - p) up to O(s^2n) gives up to n more
coefficients from one evaluation of f and the first coefficients of Df alone: Newton's method on
power series, whose corrections follow one after the other (Brent, Kung 1978, Journal of the ACM
25, 581). Then only products of long series take long, and these are computed inside FLINT;
recurrences of single coefficients, as in `solvers.taylor`, would run in Python.

The results are enclosures: each operation encloses the exact result for each point of the balls
that it is given.
"""

import dataclasses

from jaxdyn.ball_arithmetic.arithmetic import arb, arb_mat, arb_series, unit_matrix
from jaxdyn.ball_arithmetic.field import BallField

#: To find a motion alone, coefficients of the derivative are computed up to this fraction of the
#: order, 1 / 4: more of them save evaluations of the rate, each of which costs less [measured: flat
#: from 1/6 to 1/3].
_BLOCKS = 4


@dataclasses.dataclass(frozen=True)
class Slopes:
    """Coefficients of the rate's derivative A along a motion.

    Most entries are constant, such as those of positions by velocities, and are only in `first`.

    Attributes:
      first: (k, k) A at s = 0.
      rows: rows of entries that vary.
      columns: columns of entries that vary.
      rest: coefficients 1, 2, ... of A in those rows and columns.
    """

    first: arb_mat
    rows: list[int]
    columns: list[int]
    rest: list[arb_mat]

    @property
    def length(self) -> int:
        """Number of coefficients."""
        return 1 + len(self.rest)

    def convolve(self, factors: list[arb_mat], parts: list[arb_mat]) -> arb_mat:
        """The sum of A_i X_j-i over i = 0 to j, or as many as there are.

        Args:
          factors: (k, m) X_0 to X_j.
          parts: the rows of these with the indices `columns`.
        """
        total = self.first * factors[-1]
        if not self.rest or len(factors) == 1 or not self.rows:
            return total
        pairs = zip(self.rest, reversed(parts[:-1]), strict=False)
        a, x = next(pairs)
        varying = a * x
        for a, x in pairs:
            varying += a * x
        table = total.tolist()
        for i, row in zip(self.rows, varying.tolist(), strict=True):
            table[i] = [p + q for p, q in zip(table[i], row, strict=True)]
        return arb_mat(table)

    def part(self, factor: arb_mat) -> arb_mat:
        """The rows of a factor that meet varying entries."""
        table = factor.tolist()
        return arb_mat([table[j] for j in self.columns])


def motion_series(field: BallField, t: arb, y: list, order: int) -> list[list]:
    """(k) lists of the coefficients 0 to `order` of the motion from y at t."""
    coefficients = [[entry] for entry in y]
    enough = max(order // _BLOCKS, 1)
    slopes: Slopes | None = None
    known = 1
    while known <= order:
        if slopes is None or slopes.length < min(known, enough):
            slopes = slope_series(field, t, coefficients, known)
        gained = min(slopes.length, order + 1 - known)
        rates = field.rates(_inputs(field, t, coefficients, known + gained - 1))
        corrections: list[arb_mat] = []
        parts: list[arb_mat] = []
        for j in range(known - 1, known + gained - 1):
            total = arb_mat(field.k, 1, [_coefficient(rate, j) for rate in rates])
            if corrections:
                total += slopes.convolve(corrections, parts)
            # Coefficient j + 1 of the motion.
            corrections.append(total * (1 / arb(j + 1)))
            parts.append(slopes.part(corrections[-1]))
        for correction in corrections:
            for row, entry in zip(coefficients, correction.entries(), strict=True):
                row.append(entry)
        known += gained
    return coefficients


def slope_series(field: BallField, t: arb, coefficients: list[list], length: int) -> Slopes:
    """Coefficients 0 to length - 1 of the rate's derivative along a motion."""
    k = field.k
    flat = field.slopes(_inputs(field, t, coefficients, length))[k:]
    table = [flat[i * k : (i + 1) * k] for i in range(k)]
    varying = [(i, j) for i in range(k) for j in range(k) if isinstance(table[i][j], arb_series)]
    rows, columns = (sorted({place[n] for place in varying}) for n in (0, 1))
    parts = [[table[i][j] for j in columns] for i in rows]
    rest = [[[_coefficient(x, n) for x in row] for row in parts] for n in range(1, length)]
    first = arb_mat([[_coefficient(x, 0) for x in row] for row in table])
    return Slopes(first, rows, columns, [arb_mat(x) if rows else arb_mat(0, 0) for x in rest])


def transition_series(slopes: Slopes, order: int) -> list[arb_mat]:
    """Coefficients 0 to `order` of X (k, k), with X' = A X and X = 1 at first.

    Args:
      slopes: at least `order` coefficients of A.
      order: order of the last coefficient.
    """
    k = slopes.first.nrows()
    found = [unit_matrix(k)]
    parts = [slopes.part(found[0])]
    for j in range(order):
        found.append(slopes.convolve(found, parts) * (1 / arb(j + 1)))
        parts.append(slopes.part(found[-1]))
    return found


def at(coefficients: list, h: arb):
    """The sum of coefficients times powers of h, of numbers or of matrices."""
    total = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        total = total * h + c
    return total


def _inputs(field: BallField, t: arb, coefficients: list, length: int) -> dict:
    y = [arb_series(c[:length], length) for c in coefficients]
    return field.inputs(arb_series([t, 1], length), y)


def _coefficient(x, j: int):
    """Coefficient j of a series, or of a constant.

    python-flint reads 0 beyond the last coefficient that it knows.
    """
    if not isinstance(x, arb_series):
        return x if j == 0 else 0
    if j >= x.prec:
        raise ArithmeticError(f"Only {x.prec} coefficients are known.")
    return x[j]
