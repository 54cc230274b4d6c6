"""Equations of equilibria, folds, branch points and Hopf points, with exact Jacobians.

With x = (y, p), the rate f(y, p), A = df/dy and b = df/dp:

- Equilibrium: f = 0.
- Fold: f = 0, A v = 0, l v = 1.
- Branch point: f + e u = 0, A^T u = 0, b u = 0, l u = 1, with an unfolding parameter e, which is
  0 at the solution. Without e the system would have more equations than unknowns.
- Hopf point: f = 0, A v = -w r, A r = w v, l (v + i r) = 1: the eigenvector v + i r of i w.

Each system is regular at a generic point of its kind, so that Newton's method converges
quadratically.

Reference: Govaerts (2000), Numerical Methods for Bifurcations of Dynamical Equilibria, chapters 3
and 4; Moore (1980), Numer. Funct. Anal. Optim. 2, 441, for branch points.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.continuation import newton
from jaxdyn.continuation.newton import Solution
from jaxdyn.scene import Scene

Make = Callable[[Array], Scene]
#: A function (make, unknowns, normalisation) -> residual.
System = Callable[..., Array]

#: Largest residual of a solution, relative to 1 + the largest entry of the Jacobian.
GOAL = 1e-10


def rate(make: Make, x: Array) -> Array:
    """(k,) rate of the scene at the state and the parameter x (k + 1,)."""
    return make(x[-1]).rate(jnp.zeros(()), x[:-1])


def slope(make: Make, x: Array) -> Array:
    """(k, k + 1) derivative [A, b] of the rate."""
    return jax.jacfwd(lambda x: rate(make, x))(x)


def fold(make: Make, unknowns: Array, normal: Array) -> Array:
    """The equations of a fold; unknowns (y, p, v)."""
    k = len(unknowns) // 2
    x, v = unknowns[: k + 1], unknowns[k + 1 :]
    value, along = jax.jvp(lambda x: rate(make, x), (x,), (jnp.append(v, 0.0),))
    return jnp.concatenate([value, along, (normal @ v - 1.0)[None]])


def branch(make: Make, unknowns: Array, normal: Array) -> Array:
    """The equations of a branch point; unknowns (y, p, u, e)."""
    k = (len(unknowns) - 2) // 2
    x, u, unfolding = unknowns[: k + 1], unknowns[k + 1 : -1], unknowns[-1]
    value, transposed = jax.vjp(lambda x: rate(make, x), x)
    return jnp.concatenate([value + unfolding * u, transposed(u)[0], (normal @ u - 1.0)[None]])


def hopf(make: Make, unknowns: Array, normal: Array) -> Array:
    """The equations of a Hopf point; unknowns (y, p, v, r, w), normal (2, k)."""
    k = normal.shape[1]
    x, w = unknowns[: k + 1], unknowns[-1]
    v, r = unknowns[k + 1 : 2 * k + 1], unknowns[2 * k + 1 : -1]
    value, derivative = jax.linearize(lambda x: rate(make, x), x)
    real = derivative(jnp.append(v, 0.0)) + w * r
    imaginary = derivative(jnp.append(r, 0.0)) - w * v
    normalised = jnp.stack([normal[0] @ v - normal[1] @ r - 1.0, normal[0] @ r + normal[1] @ v])
    return jnp.concatenate([value, real, imaginary, normalised])


def arc(make: Make, unknowns: Array, normal: Array) -> Array:
    """The equations of an equilibrium in a hyperplane; unknowns (y, p), normal (2, k + 1).

    The rows of `normal` are a point of the plane and the direction normal to it.
    """
    point, along = normal
    return jnp.append(rate(make, unknowns), along @ (unknowns - point))


def solve(system: System, make: Callable, start: np.ndarray, normal: Any) -> Solution | None:
    """The solution of a system near a start; None if there is none."""
    found = newton.solve(lambda x: _linearize(system, make, x, normal), start, polish=1)
    goal = GOAL * (1.0 + np.abs(found.jacobian).max())
    return found if found.settled and found.residual <= goal else None


def jacobian(system: System, make: Callable, x: np.ndarray, normal: Any) -> np.ndarray:
    """The Jacobian (m, m) of a system."""
    return np.asarray(_linearize(system, make, x, normal)[1])


@eqx.filter_jit
def _linearize(system: System, make: Callable, x: Array, normal: Any) -> tuple[Array, Array]:
    return value_and_jacfwd(lambda x: system(make, x, normal))(x)


@eqx.filter_jit
def slope_at(make: Make, x: Array) -> Array:
    """The result of `slope`, by one compiled program."""
    return slope(make, x)
