"""The non-trivial multipliers of a monodromy matrix in balls.

Multipliers that are 1 by an integral or a symmetry come in defective groups, whose computed values
would be as uncertain as a root of the rounding. The characteristic polynomial knows no such
trouble: divided by (x - 1) as often as the theory says, it has the others as simple roots.
"""

import math

from jaxdyn.balls.arithmetic import acb, acb_poly, arb, arb_mat

_NEWTON_STEPS = 30


def deflated(matrix: arb_mat, unit: int) -> list[arb]:
    """Coefficients of the characteristic polynomial divided by (x - 1)^unit, lowest first."""
    coefficients = matrix.charpoly().coeffs()
    for _ in range(unit):
        coefficients, _ = _divided(coefficients)
    return coefficients


def multiplicity(matrix: arb_mat, error: float) -> int:
    """How often 1 is a multiplier, if numbers below an error are 0; not proved."""
    coefficients = matrix.charpoly().coeffs()
    count = 0
    while len(coefficients) > 1:
        size = max(abs(float(c.mid())) for c in coefficients)
        quotient, rest = _divided(coefficients)
        if not abs(float(rest.mid())) <= error * size:
            break
        coefficients, count = quotient, count + 1
    return count


def roots(coefficients: list[arb], error: arb | None = None) -> list[acb]:
    """Enclosures of the roots, each of one root, to an error; [] if they cannot be told apart."""
    if len(coefficients) < 2:
        return []
    polynomial = acb_poly(coefficients)
    try:
        found = polynomial.roots(tol=error)
    except (ValueError, ZeroDivisionError):
        return []
    return [_sharpened(polynomial, z) for z in found]


def _sharpened(polynomial: acb_poly, z: acb) -> acb:
    """A narrower enclosure of the root in a ball, by interval Newton steps.

    The root lies in mid z - p(mid z) / p'(z), as it does in z.
    """
    slope = polynomial.derivative()
    for _ in range(_NEWTON_STEPS):
        middle = z.mid()
        step = middle - polynomial(middle) / slope(z)
        if not float(step.rad()) < 0.5 * float(z.rad()):
            break
        z = step
    return z


def _divided(coefficients: list[arb]) -> tuple[list[arb], arb]:
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
    """Largest first, the one with positive imaginary part before its conjugate."""
    return sorted(found, key=lambda z: (-_size(z), -float(z.imag.mid())))


def _size(z: acb) -> float:
    x = float(abs(z).mid())
    return round(x, 9) if math.isfinite(x) else x
