"""Corrections of the rounded weights of Runge-Kutta and Nystrom tables.

Rounded tables break the order conditions in the 17th digit, at every step in the same way, so that
energies drift in proportion to time although each sum is compensated. A change of a few weights
restores them; `Advance.rest` carries its effect on a step.
"""

from fractions import Fraction

import numpy as np

_CORRECTED_STAGES = 4  # stages whose weights are corrected


def lacking(
    c: np.ndarray, a: np.ndarray, weights: np.ndarray, order: int, *, position_only: bool
) -> np.ndarray:
    """(w, s) a correction of a few weights that restores the order conditions.

    Defects of the order conditions are found in rational arithmetic; they are so small that
    the change need only be right to a few digits. The vectors of the conditions are nearly
    powers of the nodes, up to the third, so four stages at different times are enough.
    """
    exact_a = [[Fraction(x) for x in row] for row in a.tolist()]
    exact_c = [Fraction(x) for x in c.tolist()]
    rows = []
    for i, given in enumerate(weights):
        used = np.flatnonzero(given)
        _, apart = np.unique(c[used], return_index=True)
        spread = np.unique(np.linspace(0, len(apart) - 1, _CORRECTED_STAGES).round().astype(int))
        few = used[apart[spread]]
        conditions = [x for x in _conditions(exact_a, exact_c, position_only, i) if x[0] <= order]
        exact = [Fraction(w) for w in given.tolist()]
        defects = [value - sum(exact[j] * x[j] for j in used) for _, x, value in conditions]
        matrix = np.array([[float(x[j]) for j in few] for _, x, _ in conditions])
        change, *_ = np.linalg.lstsq(matrix, np.array([float(d) for d in defects]), rcond=1e-9)
        row = np.zeros(len(c))
        row[few] = change
        rows.append(row)
    return np.array(rows)


def _conditions(
    a: list, c: list, position_only: bool, row: int
) -> list[tuple[int, list, Fraction]]:
    """(order, stage vector, value): the weights times the vector is the value; orders up to 4.

    Row 0 of a Nystrom pair weighs positions, row 1 velocities. Vectors are sums over rooted
    trees (Hairer, Norsett, Wanner, II.2 and II.14), with the nodes that the rows of a sum to.
    """
    one = [Fraction(1)] * len(a)

    def applied(x):
        return [sum(w * xi for w, xi in zip(r, x, strict=True) if w) for r in a]

    def times(x, y):
        return [p * q for p, q in zip(x, y, strict=True)]

    g = applied(one)
    if position_only:
        trees = [(1, one, 1), (2, c, 2), (3, times(c, c), 3), (3, g, 6)]
        trees += [(4, times(c, times(c, c)), 4), (4, times(c, g), 8), (4, applied(c), 24)]
        if row == 0:  # one order later, weighted by the remainder of the step
            left = (2, 6, 12, 24)
            trees = [(n + 1, x, w) for (n, x, _), w in zip(trees[:4], left, strict=True)]
    else:
        gg, ag = times(g, g), applied(g)
        trees = [(1, one, 1), (2, g, 2), (3, gg, 3), (3, ag, 6), (4, times(g, gg), 4)]
        trees += [(4, times(g, ag), 8), (4, applied(gg), 12), (4, applied(ag), 24)]
    return [(n, x, Fraction(1, value)) for n, x, value in trees]
