"""Elementary functions in ball arithmetic: of numbers, of power series, on complex discs.

A ball [m +- r] of python-flint's `arb` contains the exact result of each operation whose operands
contain the exact operands (Johansson 2017, IEEE Transactions on Computers 66, 1281). A number
known to the program is exactly the binary float that it is: 0.1 stands for 0.1000000000000000055,
and ``jnp.pi`` for the float nearest to pi.
"""

import contextlib
import dataclasses
from collections.abc import Iterator

import numpy as np

from jaxdyn._checks import fail

try:
    import flint
    from flint import acb, acb_poly, arb, arb_mat, arb_series
except ImportError as error:
    missing = "Install it: pip install 'jaxdyn[proof]'."
    raise fail("proof", "the package python-flint", "none", missing) from error

#: The kinds of numbers, which other files import from here.
__all__ = ["acb", "acb_poly", "arb", "arb_mat", "arb_series"]


@contextlib.contextmanager
def precision(bits: int, order: int = 1) -> Iterator[None]:
    """A context in which calculations have this many bits, and series go up to this order."""
    before = flint.ctx.prec, flint.ctx.cap
    flint.ctx.prec, flint.ctx.cap = bits, order + 1
    try:
        yield
    finally:
        flint.ctx.prec, flint.ctx.cap = before


def column(vector: list) -> arb_mat:
    """(n, 1) a vector as a matrix."""
    return arb_mat([[x] for x in vector])


def unit_matrix(n: int) -> arb_mat:
    """(n, n) the unit matrix."""
    return arb_mat([[int(i == j) for j in range(n)] for i in range(n)])


def midpoints(matrix: arb_mat) -> arb_mat:
    """A matrix of the midpoints, which are exact."""
    return arb_mat([[x.mid() for x in row] for row in matrix.tolist()])


def float_matrix(matrix: arb_mat) -> np.ndarray:
    """A matrix in floats."""
    return np.array([[float(x.mid()) for x in row] for row in matrix.tolist()])


class Undecided(ArithmeticError):
    """Raised if a condition holds for some numbers of a ball and not for others."""


@dataclasses.dataclass(frozen=True)
class Functions:
    """The elementary functions of a kind of numbers.

    Attributes:
      analytic: whether the result must be NaN unless the function is analytic on the ball, as
        Cauchy's estimates need it.
    """

    analytic: bool = False

    def sqrt(self, x):
        """The square root."""
        return x.sqrt(analytic=True) if self.analytic and isinstance(x, acb) else x.sqrt()

    def rsqrt(self, x):
        """One over the square root."""
        return x.rsqrt(analytic=True) if self.analytic and isinstance(x, acb) else x.rsqrt()

    def log(self, x):
        """The logarithm."""
        return x.log(analytic=True) if self.analytic and isinstance(x, acb) else x.log()

    def atan(self, x):
        """The inverse tangent; for complex balls by logarithms, whose branch cuts are known."""
        if self.analytic and isinstance(x, acb):
            turned = acb(0, 1) * x
            return acb(0, 0.5) * (self.log(1 - turned) - self.log(1 + turned))
        return x.atan()

    def tanh(self, x):
        """The hyperbolic tangent, which series lack."""
        return 1 - 2 / ((2 * x).exp() + 1)

    def power(self, x, n):
        """The power x^n, by square roots where 2 n is whole."""
        if isinstance(n, float) and (2 * n).is_integer():
            half, odd = divmod(int(abs(2 * n)), 2)
            if not odd:
                return x**half if n >= 0 else 1 / x**half
            root = self.sqrt(x) if n >= 0 else self.rsqrt(x)
            return root * (root * root) ** half if half else root
        return (n * self.log(x)).exp()

    def apply(self, op: str, x):
        """An elementary function by its name."""
        own = getattr(self, op, None)
        return own(x) if own else getattr(x, op)()


REAL, COMPLEX = Functions(), Functions(analytic=True)
