"""The non-trivial multipliers of a monodromy matrix in balls.

Multipliers that are 1 by an integral or a symmetry come in defective groups, whose computed values
would be as uncertain as a root of the rounding. Where the reason for each is known as a vector,
`reduce` reduces the matrix to the others, which are simple. Where only their number is known,
`deflate` divides the characteristic polynomial by x - 1 a number of times.
"""

import math

import numpy as np

from jaxdyn.ball_arithmetic.arithmetic import acb, acb_poly, arb, arb_mat
from orbits.proof.closing_equations import inverse

_NEWTON_STEPS = 30
#: Bits with which roots may be sought. Those that nearly meet need more than coefficients have,
#: whose midpoints are exact.
_MOST_BITS = 20_000


def reduce(matrix: arb_mat, rows: list[list], directions: list[list]) -> arb_mat:
    """(k - n - m, ...) the action of a matrix on a kernel modulo directions in it.

    Args:
      matrix: (k, k) the matrix.
      rows: (n) row vectors (k) whose span it leaves invariant.
      directions: (m) vectors (k) of their common kernel whose span it leaves invariant.
    Raises:
      ArithmeticError: the rows, or the directions, may depend on each other.
    """
    k, n, m = matrix.nrows(), len(rows), len(directions)
    known = np.array([[float(x.mid()) for x in row] for row in (*rows, *directions)]).reshape(-1, k)
    known = known / np.linalg.norm(known, axis=1, keepdims=True)
    others = np.linalg.svd(known)[2][n + m :].T
    kept, inside = arb_mat(others.tolist()), arb_mat(others.tolist())
    columns = [*directions]
    if n and len(others.T):
        w = arb_mat(rows)
        # Project them onto the kernel of the exact rows.
        inside = kept - w.transpose() * ((w * w.transpose()).inv() * (w * kept))
    columns += np.array(inside.tolist(), object).reshape(k, -1).T.tolist()
    whole = arb_mat([*columns, *rows]).transpose()
    moved = (inverse(whole) * (matrix * inside)).tolist()
    return arb_mat(moved[m : k - n])


def deflate(matrix: arb_mat, unit: int) -> list[arb]:
    """Coefficients of the characteristic polynomial divided by (x - 1)^unit, lowest first."""
    coefficients = matrix.charpoly().coeffs()
    for _ in range(unit):
        coefficients, _ = _divide(coefficients)
    return coefficients


def multiplicity(matrix: arb_mat, error: float) -> int:
    """The multiplicity of the multiplier 1 if numbers below an error are 0; it is not proved."""
    coefficients = matrix.charpoly().coeffs()
    count = 0
    while len(coefficients) > 1:
        size = max(abs(float(c.mid())) for c in coefficients)
        quotient, rest = _divide(coefficients)
        if not abs(float(rest.mid())) <= error * size:
            break
        coefficients, count = quotient, count + 1
    return count


def roots(coefficients: list[arb], error: arb | None = None) -> list[acb]:
    """An enclosure of each root, no wider than `error`; [] if roots cannot be separated."""
    if len(coefficients) < 2:
        return []
    polynomial = acb_poly(coefficients)
    try:
        found = polynomial.roots(tol=error, maxprec=_MOST_BITS)
    except (ValueError, ZeroDivisionError):
        return []
    return [_sharpen(polynomial, z) for z in found]


def _sharpen(polynomial: acb_poly, z: acb) -> acb:
    """A narrower enclosure of the root in a ball, by interval Newton steps.

    If the root lies in z, it lies in mid z - p(mid z) / p'(z) as well.
    """
    slope = polynomial.derivative()
    for _ in range(_NEWTON_STEPS):
        middle = z.mid()
        step = middle - polynomial(middle) / slope(z)
        if not float(step.rad()) < 0.5 * float(z.rad()):
            break
        z = step
    return z


def _divide(coefficients: list[arb]) -> tuple[list[arb], arb]:
    """The quotient by x - 1 and the remainder, by Horner's rule."""
    quotient: list[arb] = []
    carry = arb(0)
    for c in reversed(coefficients):
        carry = carry + c
        quotient.append(carry)
    rest = quotient.pop()
    return quotient[::-1], rest


def rotation_number(z: acb) -> arb:
    """arg z / (2 pi), in [0, 1/2] for Im z >= 0."""
    return z.arg() / (2 * arb.pi())


def sorted_roots(found: list[acb]) -> list[acb]:
    """The roots, largest first, each with positive imaginary part before its conjugate."""

    def rank(z: acb) -> tuple[float, ...]:
        size = float(abs(z).mid())
        # The sizes of conjugates differ only by rounding, those of real ones by more.
        imaginary = 0.0 if z.imag.contains(0) else float(z.imag.mid())
        return -(round(size, 9) if math.isfinite(size) else size), -imaginary, -size

    return sorted(found, key=rank)
