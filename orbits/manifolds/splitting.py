"""An equilibrium and the subspaces of its linear flow as functions of a parameter of the scene.

Projectors follow from the matrix sign function, whose Newton iteration is differentiable;
eigenvectors would need a phase, and have no derivative where two eigenvalues meet.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn.analysis.equilibria import equilibrium

#: Newton steps for the sign function: each halves a large or doubles a small eigenvalue; the last
#: six converge quadratically.
_SIGN_STEPS = 40


class Split(NamedTuple):
    """An equilibrium (k,), the Jacobian (k, k), and the projector (k, k) on the upper subspace."""

    rest: Array
    jacobian: Array
    projector: Array


def split(scene: Scene, near: Array, cut: Array, each: Array) -> Split:
    """The equilibrium near a state, with the subspace of eigenvalues of real part above `cut`.

    The iteration is in units of the sizes `each` (k,) of the entries.
    """
    rest = equilibrium(scene, near)
    jacobian = jax.jacfwd(lambda y: scene.rate(jnp.zeros(()), y))(rest)
    one = jnp.eye(len(rest))
    units = each[None, :] / each[:, None]
    shifted = jacobian * units - cut * one
    sign = jax.lax.fori_loop(
        0, _SIGN_STEPS, lambda _, s: 0.5 * (s + jnp.linalg.inv(s)), shifted / jnp.max(abs(shifted))
    )
    return Split(rest, jacobian, 0.5 * (one + sign / units))
