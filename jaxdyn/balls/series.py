"""Taylor coefficients of a motion, and of its derivative by the start, in balls.

Let p be the first n coefficients of a solution of y' = f(y). Then y = p + O(s^n), and since f is
evaluated on series as a whole, f(y) = f(p) + Df(p) (y - p) up to O(s^2n) gives up to n more
coefficients from one evaluation of f and the first coefficients of Df alone: Newton's method on
power series, whose corrections follow one after the other (Brent, Kung 1978, Journal of the ACM
25, 581). All that takes long are then products of long series, inside FLINT; recurrences of
single coefficients, as in `solvers.taylor`, would run in Python.

A ball encloses: each operation encloses the exact one for each point of the balls it starts from.
"""

from jaxdyn.balls.arithmetic import arb, arb_mat, arb_series
from jaxdyn.balls.field import BallField

#: Part of the order for which coefficients of the derivative are computed to find a motion alone:
#: more of them save evaluations of the rate, which cost less each [measured: flat from 1/6 to 1/3].
_BLOCKS = 4


def motion_series(field: BallField, t: arb, y: list, unfolding: list, order: int) -> list[list]:
    """(k) lists of the coefficients 0 to `order` of the motion from y at t."""
    coefficients = [[entry] for entry in y]
    enough = max(order // _BLOCKS, 1)
    slopes: list[arb_mat] = []
    known = 1
    while known <= order:
        if len(slopes) < min(known, enough):
            _, slopes, _ = slope_series(field, t, coefficients, unfolding, known)
        gained = min(len(slopes), order + 1 - known)
        rates = _rates(field, t, coefficients, unfolding, known + gained - 1)
        corrections: list[arb_mat] = []
        for j in range(known - 1, known + gained - 1):
            total = arb_mat(field.k, 1, [_coefficient(rate, j) for rate in rates])
            for i, correction in enumerate(reversed(corrections)):
                total += slopes[i] * correction
            # Coefficient j + 1 of the motion.
            corrections.append(total * (1 / arb(j + 1)))
        for correction in corrections:
            for row, entry in zip(coefficients, correction.entries(), strict=True):
                row.append(entry)
        known += gained
    return coefficients


def slope_series(
    field: BallField, t: arb, coefficients: list[list], unfolding: list, length: int
) -> tuple[list, list[arb_mat], list[arb_mat]]:
    """The rates, and coefficients 0 to length - 1 of their derivatives by y and by unfolding."""
    inputs = _inputs(field, t, coefficients, unfolding, length)
    found = field.slopes(inputs)
    k, n = field.k, field.n
    rates = found[:k]
    table = [found[k + i * (k + n) : k + (i + 1) * (k + n)] for i in range(k)]
    by_state = [_matrix([row[:k] for row in table], j) for j in range(length)]
    by_unfolding = [_matrix([row[k:] for row in table], j) for j in range(length)] if n else []
    return rates, by_state, by_unfolding


def transition_series(slopes: list[arb_mat], forcing: list[arb_mat], order: int) -> list[arb_mat]:
    """Coefficients 0 to `order` of X (k, k + n), with X' = A X + [0 B] and X = [1 0] at first.

    Args:
      slopes: `order` coefficients of A (k, k).
      forcing: those of B (k, n), or none.
      order: that of the last coefficient.
    """
    k = slopes[0].nrows()
    n = forcing[0].ncols() if forcing else 0
    found = [arb_mat([[int(i == j) for j in range(k + n)] for i in range(k)])]
    for j in range(order):
        total = slopes[0] * found[j]
        for i in range(1, j + 1):
            total += slopes[i] * found[j - i]
        if n:
            total += _widened(forcing[j], k)
        found.append(total * (1 / arb(j + 1)))
    return found


def at(coefficients: list, h: arb):
    """The sum of coefficients times powers of h, of numbers or of matrices."""
    total = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        total = total * h + c
    return total


def _rates(field: BallField, t: arb, coefficients: list, unfolding: list, length: int) -> list:
    return field.rates(_inputs(field, t, coefficients, unfolding, length))


def _inputs(field: BallField, t: arb, coefficients: list, unfolding: list, length: int) -> dict:
    y = [arb_series(c[:length], length) for c in coefficients]
    return field.inputs(arb_series([t, 1], length), y, unfolding)


def _matrix(table: list[list], j: int) -> arb_mat:
    return arb_mat([[_coefficient(x, j) for x in row] for row in table])


def _coefficient(x, j: int):
    """Coefficient j of a series, or of a constant.

    python-flint reads 0 beyond the last coefficient that it knows.
    """
    if not isinstance(x, arb_series):
        return x if j == 0 else 0
    if j >= x.prec:
        raise ArithmeticError(f"Only {x.prec} coefficients are known.")
    return x[j]


def _widened(matrix: arb_mat, k: int) -> arb_mat:
    return arb_mat([[0] * k + row for row in matrix.tolist()])
