"""Krawczyk's theorem: whether a box of balls has exactly one zero of an equation, and where.

Theorem (Krawczyk 1969, Computing 4, 187; Neumaier 1990, Interval Methods for Systems of Equations,
section 5.1). Let F be differentiable on a box X with centre x, D a matrix of intervals that
contains F'(z) for all z in X, C any matrix, and

    K = x - C F(x) + (1 - C D) (X - x).

Each zero of F in X lies in K. If K lies in the interior of X, F has exactly one zero in X.

Proof. For z in X the mean value theorem, row by row, gives F(z) - F(x) = M (z - x) with M in D,
since D is a box of matrices. So N(z) = z - C F(z) = x - C F(x) + (1 - C M)(z - x) lies in K. If
F(z) = 0, N(z) = z. If K is in the interior of X, N has a fixed point z in X (Brouwer). K in the
interior of X needs |1 - C D| r < r for the radii r of X, so that every C M is regular, hence also
C, and F(z) = 0. Two zeros z, w would have 0 = C (F(z) - F(w)) = C M (z - w) with C M regular, so
that z = w.
"""

from typing import NamedTuple

from jaxdyn.ball_arithmetic.arithmetic import arb, arb_mat, column, unit_matrix


class Krawczyk(NamedTuple):
    """The map from X - x to K - x.

    Attributes:
      shift: (n, 1) C F(x).
      rest: (n, n) 1 - C D.
    """

    shift: arb_mat
    rest: arb_mat

    @classmethod
    def of(cls, error: list[arb], slopes: arb_mat, inverse: arb_mat) -> "Krawczyk":
        """The map of F(x) (n), D (n, n) and C (n, n)."""
        return cls(inverse * column(error), unit_matrix(slopes.nrows()) - inverse * slopes)

    def __call__(self, offset: list[arb]) -> list[arb]:
        """(n) K - x from X - x (n).

        From a smaller box that contains the zero, such as K, it leads to one that does too.
        """
        return (self.rest * column(offset) - self.shift).entries()


def is_inside(step: list[arb], offset: list[arb]) -> bool:
    """Whether K - x lies in the interior of X - x, whose balls are centred at 0."""
    return all(bool(abs(x) < side.rad()) for x, side in zip(step, offset, strict=True))
