"""Normal-form coefficients of folds, branch points and Hopf points of equilibria.

With B and C the second and third derivatives of the rate as symmetric forms, for |q| = 1 in the
units of the scene, in which the entries have units `each`:

- Fold and branch point, with null vectors A q = 0, A^T p = 0, p q = 1: the coefficients of
  z' = a z^2 + c z^3, a = p B(q, q) / 2 and c = p C(q, q, q) / 6 - p B(q, h) / 2, with
  A h = B(q, q) - p B(q, q) q and p h = 0. At a fold a = 0 is a cusp; at a branch point a = 0 is a
  pitchfork. Where the eigenvalue 0 is double, as in conservative scenes, p q = 0: with A r = q and
  p r = 1 they are the coefficients of z'' = a z^2 + c z^3, with r in place of q in A h.
- Hopf point: the Lyapunov coefficients.

The terms with B and C are Taylor coefficients of the rate along curves of states such as
e q - e^2 h / 2, exact by nested forward mode: no tensor is formed.

Reference: Kuznetsov (2004), Elements of Applied Bifurcation Theory, 3rd edition, chapters 5 and 8.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import taylor_coefficients
from jaxdyn.continuation.defining import Make, rate

# ---- The Lyapunov coefficients of a Hopf point: the second one decides where the first vanishes
#
# On the centre manifold x = W(z, z*) the rate has the normal form z' = i w z + c1 z |z|^2 +
# c2 z |z|^4. Order by order in the size e of z = e exp(i u), the coefficient of e^n in F(W), as a
# Fourier sum in u, must be that in W' = W_z z' + its conjugate: a linear system for each harmonic m
# of W_n, with the matrix i m w - A. It is singular for m = 1, where its solvability gives c1 for
# n = 3 and c2 for n = 5. The series of F are those along one curve for each of the phases that
# distinguish the harmonics.
#
# Reference: Kuznetsov (2004), Elements of Applied Bifurcation Theory, 3rd edition, section 8.7.

_ORDER = 5
_PHASES = 2 * _ORDER + 1  # harmonics -5 to 5


def lyapunov_coefficients(
    make: Make, x: np.ndarray, a: np.ndarray, frequency: float, each: np.ndarray | float = 1.0
) -> tuple[float, float]:
    """The first and the second Lyapunov coefficient, Re c1 / w and Re c2 for a unit eigenvector.

    Where the first one does not vanish, the second depends on the choice of coordinates.

    Args:
      make: parameter -> scene.
      x: (k + 1,) state and parameter.
      a: (k, k) Jacobian there.
      frequency: w [rad per time].
      each: units (k,) of the entries; the eigenvector has unit length in those of the scene.
    """
    c, length = _resonant_terms(make, x, a, frequency, each, _ORDER)
    return float(c[1].real / frequency / length**2), float(c[2].real / length**4)


def first_lyapunov(
    make: Make, x: np.ndarray, a: np.ndarray, frequency: float, each: np.ndarray | float = 1.0
) -> float:
    """The first Lyapunov coefficient of a Hopf point; negative where its orbits are stable.

    They are stable within the centre manifold. See `lyapunov_coefficients`.
    """
    c, length = _resonant_terms(make, x, a, frequency, each, 3)
    return float(c[1].real / frequency / length**2)


def _resonant_terms(
    make: Make, x: np.ndarray, a: np.ndarray, frequency: float, each, most: int
) -> tuple[dict[int, complex], float]:
    """The numbers c1 and c2 up to an order `most` in e, and the length of the eigenvector."""
    k, eye = len(a), np.eye(len(a))
    q = np.conj(np.linalg.svd(a - 1j * frequency * eye)[2][-1])
    p = np.linalg.svd(a.T - 1j * frequency * eye)[2][-1].conj()
    p = p / (p @ q)
    turns = np.exp(2j * np.pi * np.arange(_PHASES) / _PHASES)
    parts: dict[tuple[int, int], np.ndarray] = {(1, 1): q}
    c: dict[int, complex] = dict.fromkeys((1, 2), 0j)
    for n in range(2, most + 1):
        curves = np.zeros((_PHASES, _ORDER, k))
        for (order, m), w in parts.items():
            wave = np.outer(turns**m, w)
            curves[:, order - 1] += wave.real if m == 0 else 2 * wave.real
        new = np.asarray(_coefficient(make, x, curves, order=n))
        for m in range(n, -1, -2) if n < most else (1,):
            right = turns ** (-m) @ new / _PHASES
            for i in (1, 2):
                lower = n - 2 * i
                if lower >= max(m, 1) and (lower, m) != (1, 1):
                    j, back = (lower + m) // 2, (lower - m) // 2
                    right = right - parts[lower, m] * (j * c[i] + back * np.conj(c[i]))
            if m == 1:
                c[n // 2] = complex(p @ right)
                right = right - c[n // 2] * q
                parts[n, m] = solve_bordered(1j * frequency * eye - a, q, p, right)
            else:
                parts[n, m] = np.linalg.solve(1j * m * frequency * eye - a, right)
    return c, float(np.linalg.norm(q * each))


@eqx.filter_jit
def _coefficient(make: Make, x: Array, curves: Array, *, order: int) -> Array:
    """(phases, k) coefficients of e^order in the rate along x + sum over n of curve_n e^n."""

    def along(curve):
        def value(e):
            off = jnp.zeros_like(curve[0])
            for term in curve[:order][::-1]:
                off = (off + term) * e
            return rate(make, x.at[:-1].add(off))

        return taylor_coefficients(value, order)[-1]

    # Not `vmap`, which takes three times as long to compile.
    return jax.lax.map(along, jnp.asarray(curves))


# ---- Normal-form coefficients of folds, branch points and Hopf points of equilibria

#: Product of unit null vectors below which they are orthogonal.
_ORTHOGONAL = 1e-8
#: Quadratic coefficient, in units where the rate is of order 1, below which it is rounding.
_SYMMETRIC = 1e-10


def null_form(
    make: Make, x: np.ndarray, a: np.ndarray, each: np.ndarray
) -> tuple[float, float, bool]:
    """The quadratic and the cubic coefficient at an eigenvalue 0, and whether it is double.

    A quadratic coefficient that is only rounding, as in a symmetric scene, is 0. Both are NaN where
    the eigenvalue has more than one eigenvector, or is triple.

    Args:
      make: parameter -> scene.
      x: (k + 1,) state and parameter.
      a: (k, k) Jacobian there.
      each: units of the entries.
    """
    u, _, vt = np.linalg.svd(a)
    q, p = vt[-1], u[:, -1]
    double = bool(abs(p @ q) < _ORTHOGONAL)
    # The sign of q is arbitrary: it is chosen so that its largest entry is positive.
    q = q * np.sign(q[np.argmax(np.abs(q))])
    r = np.linalg.lstsq(a, q)[0] if double else q
    if abs(p @ r) < _ORTHOGONAL * np.linalg.norm(r):
        return math.nan, math.nan, double
    p = p / (p @ r)
    curve = np.zeros((1, _ORDER, len(a)))
    curve[0, 0] = q
    (half,) = np.asarray(_coefficient(make, x, curve, order=2))
    quadratic, right = p @ half, half - (p @ half) * r
    # A multiple of q in h changes c only where the quadratic coefficient is not 0: c is not unique
    # there.
    curve[0, 1] = -(np.linalg.lstsq(a, right)[0] if double else solve_bordered(a, q, p, right))
    (third,) = np.asarray(_coefficient(make, x, curve, order=3))
    length = float(np.linalg.norm(q * each))
    if abs(quadratic) < _SYMMETRIC:
        quadratic = 0.0
    return float(quadratic) / length, float(p @ third) / length**2, double


def solve_bordered(a: np.ndarray, q: np.ndarray, p: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution h of a h = right with p h = 0, where a q = 0, p a = 0 and p right = 0."""
    bordered = np.block([[a, q[:, None]], [p[None], np.zeros((1, 1))]])
    return np.linalg.solve(bordered, np.append(right, 0.0))[:-1]


def double_zero(make: Make, x: np.ndarray, a: np.ndarray, each: np.ndarray) -> tuple[float, float]:
    """The coefficients a and b at a double eigenvalue 0 with one eigenvector.

    With A q = 0, A r = q, A^T w = 0, A^T u = w, w r = u q = 1, w q = u r = 0 and |q| = 1 they are
    a = w B(q, q) / 2 and b = w B(q, r) + u B(q, q). The signs of q and w change both.
    """
    left, _, vt = np.linalg.svd(a)
    q, w = vt[-1], left[:, -1]
    q = q * np.sign(q[np.argmax(np.abs(q))])
    r = np.linalg.lstsq(a, q)[0]
    r = r - (q @ r) * q
    w = w / (w @ r)
    u = np.linalg.lstsq(a.T, w)[0]
    u = u - (u @ r) * w
    along = [np.append(direction, 0.0) for direction in (q, r)]
    twice, mixed = (second(make, x, along[0], direction) for direction in along)
    length = float(np.linalg.norm(q * each))
    return float(w @ twice) / 2 / length, float(w @ mixed + u @ twice) / length


def second(make: Make, x: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(k,) the second derivative of the rate along u and v (k + 1,), parameter included."""
    return np.asarray(_second(make, x, u, v))


@eqx.filter_jit
def _second(make: Make, x: Array, u: Array, v: Array) -> Array:
    def once(x):
        return jax.jvp(lambda x: rate(make, x), (x,), (u,))[1]

    return jax.jvp(once, (x,), (v,))[1]
