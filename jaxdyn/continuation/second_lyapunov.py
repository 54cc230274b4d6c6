"""The second Lyapunov coefficient of a Hopf point, which decides where the first one vanishes.

On the centre manifold x = W(z, z*) the rate has the normal form z' = i w z + c1 z |z|^2 +
c2 z |z|^4. Order by order in the size e of z = e exp(i u), the coefficient of e^n in F(W), as a
Fourier sum in u, must be that in W' = W_z z' + its conjugate: a linear system for each harmonic m
of W_n, with the matrix i m w - A. It is singular for m = 1, where its solvability gives c1 for
n = 3 and c2 for n = 5. The coefficients are exact derivatives, along one curve for each of the
phases that tell the harmonics apart: no tensor is formed.

Reference: Kuznetsov (2004), Elements of Applied Bifurcation Theory, 3rd edition, section 8.7.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.continuation.defining import Make, rate

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
    k, eye = len(a), np.eye(len(a))
    q = np.conj(np.linalg.svd(a - 1j * frequency * eye)[2][-1])
    p = np.linalg.svd(a.T - 1j * frequency * eye)[2][-1].conj()
    p = p / (p @ q)
    turns = np.exp(2j * np.pi * np.arange(_PHASES) / _PHASES)
    parts: dict[tuple[int, int], np.ndarray] = {(1, 1): q}
    c = dict.fromkeys((1, 2), 0j)
    for n in range(2, _ORDER + 1):
        curves = np.zeros((_PHASES, _ORDER, k))
        for (order, m), w in parts.items():
            wave = np.outer(turns**m, w)
            curves[:, order - 1] += wave.real if m == 0 else 2 * wave.real
        new = np.asarray(_coefficient(make, x, curves, order=n))
        for m in range(n, -1, -2):
            right = turns ** (-m) @ new / _PHASES
            for i in (1, 2):
                lower = n - 2 * i
                if lower >= max(m, 1) and (lower, m) != (1, 1):
                    j, back = (lower + m) // 2, (lower - m) // 2
                    right = right - parts[lower, m] * (j * c[i] + back * np.conj(c[i]))
            if m == 1:
                c[n // 2] = complex(p @ right)
                right = right - c[n // 2] * q
                border = np.block(
                    [[1j * frequency * eye - a, q[:, None]], [p[None], np.zeros((1, 1))]]
                )
                parts[n, m] = np.linalg.solve(border, np.append(right, 0.0))[:k]
            else:
                parts[n, m] = np.linalg.solve(1j * m * frequency * eye - a, right)
    length = np.linalg.norm(q * each)
    return float(c[1].real / frequency / length**2), float(c[2].real / length**4)


@eqx.filter_jit
def _coefficient(make: Make, x: Array, curves: Array, *, order: int) -> Array:
    """(phases, k) coefficients of e^order in the rate along x + sum over n of curve_n e^n."""

    def along(curve):
        def value(e):
            powers = jnp.stack([e**n for n in range(1, _ORDER + 1)])
            return rate(make, x.at[:-1].add(powers @ curve))

        functions = [value]
        for n in range(1, order + 1):

            def derivative(e, before=functions[-1], n=n):
                return jax.jvp(before, (e,), (jnp.ones(()),))[1] / n

            functions.append(derivative)
        return functions[-1](jnp.zeros(()))

    return jax.vmap(along)(jnp.asarray(curves))
