"""Equations of curves of folds and of Hopf points in two parameters, with exact Jacobians.

With x = (y, p, q), the rate f(x) and its derivative A = df/dy:

- Folds: f = 0, A v = 0, l v = 1; unknowns (x, v).
- Hopf points: f = 0, (A^2 + s) v = 0, l v = 1, m v = 0; unknowns (x, v, s) with s the frequency
  squared, and m normal to l in the plane of the critical eigenvectors. The curve passes a
  Bogdanov-Takens point at s = 0 as a regular point; beyond it the eigenvalues are real and
  opposite.

Each system has one unknown more than equations, and is regular at generic points of codimension
two.

Reference: Roose, Hlavacek (1985), SIAM J. Appl. Math. 45, 879; Govaerts (2000), Numerical Methods
for Bifurcations of Dynamical Equilibria, sections 4.1, 4.2 and 4.3.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.continuation import defining
from jaxdyn.continuation.curve import MakeOfTwo, WithSecond
from jaxdyn.continuation.kinds import Kind
from jaxdyn.continuation.newton import Solution

#: Largest sum of the two eigenvalues of a Hopf point, relative to the norm of the Jacobian.
_PAIRED = 1e-4


class Frame(NamedTuple):
    """The normalisation of the unknowns.

    Attributes:
      rows: (1, k) l, or (2, k) l and m.
      point: (k + 2,) a state and parameters.
      along: (k + 2,) normal of the plane through the point, in which the solution lies.
    """

    rows: np.ndarray
    point: np.ndarray
    along: np.ndarray


def _rate(make: MakeOfTwo, x: Array) -> Array:
    return make(x[-2], x[-1]).rate(jnp.zeros(()), x[:-2])


def fold(make: MakeOfTwo, unknowns: Array, frame: Frame) -> Array:
    """The equations of a fold in a plane; unknowns (y, p, q, v)."""
    k = frame.rows.shape[1]
    x, v = unknowns[: k + 2], unknowns[k + 2 :]
    value, along = jax.jvp(lambda x: _rate(make, x), (x,), (_in_state(v),))
    return jnp.concatenate([value, along, frame.rows @ v - 1.0, _in_plane(x, frame)])


def hopf(make: MakeOfTwo, unknowns: Array, frame: Frame) -> Array:
    """The equations of a Hopf point in a plane; unknowns (y, p, q, v, s)."""
    k = frame.rows.shape[1]
    x, v, square = unknowns[: k + 2], unknowns[k + 2 : -1], unknowns[-1]
    value, derivative = jax.linearize(lambda x: _rate(make, x), x)
    twice = derivative(_in_state(derivative(_in_state(v))))
    normalised = frame.rows @ v - jnp.array([1.0, 0.0])
    return jnp.concatenate([value, twice + square * v, normalised, _in_plane(x, frame)])


def _in_state(v: Array) -> Array:
    return jnp.concatenate([v, jnp.zeros(2)])


def _in_plane(x: Array, frame: Frame) -> Array:
    return (jnp.asarray(frame.along) @ (x - frame.point))[None]


SYSTEMS = {Kind.FOLD: fold, Kind.HOPF: hopf}


def solve(
    kind: Kind, make: MakeOfTwo, start: np.ndarray, point: np.ndarray, along: np.ndarray
) -> Solution | None:
    """The point of a curve in a plane, near a start; None if Newton's method finds none."""
    frame = Frame(rows=_rows(kind, make, start, len(point)), point=point, along=along)
    return defining.solve(SYSTEMS[kind], make, start, frame)


def tangent(
    kind: Kind, make: MakeOfTwo, unknowns: np.ndarray, along: np.ndarray
) -> np.ndarray | None:
    """(n,) the tangent of the curve, oriented along `along` (k + 2,); None if there is none."""
    size = len(along)
    frame = Frame(rows=_rows(kind, make, unknowns, size), point=unknowns[:size], along=along)
    jacobian = defining.jacobian(SYSTEMS[kind], make, unknowns, frame)
    try:
        direction = np.linalg.solve(jacobian, np.append(np.zeros(len(jacobian) - 1), 1.0))
    except np.linalg.LinAlgError:
        return None
    direction = direction / np.linalg.norm(direction[:size])
    return direction if np.isfinite(direction).all() else None


def first_unknowns(
    kind: Kind, make: MakeOfTwo, x: np.ndarray, other: float | None
) -> np.ndarray | None:
    """(n,) the unknowns near a state and parameters; None without a pair of eigenvalues.

    Args:
      kind: kind of the curve.
      make: (p, q) -> scene.
      x: (k + 2,) state and parameters.
      other: a frequency; the pair of eigenvalues whose frequency differs most from it is taken.
        None for the pair nearest to the imaginary axis.
    """
    a = slopes(make, x)[:, :-1]
    if kind == Kind.FOLD:
        return np.append(x, np.linalg.svd(a)[2][-1])
    values = np.linalg.eigvals(a)
    i, j = np.triu_indices(len(values), 1)
    sums, products = values[i] + values[j], (values[i] * values[j]).real
    if not len(sums):
        return None
    if other is None:
        best = int(np.argmin(np.abs(sums)))
    else:
        apart = np.abs(np.sqrt(np.maximum(products, 0.0)) - other)
        near = np.abs(sums) < _PAIRED * np.linalg.norm(a, 2)
        best = int(np.argmax(np.where(near, apart, -1.0)))
    square = float(products[best])
    # The vector is in the critical plane, closer to the direction in which A is largest: away from
    # the only eigenvector in the plane at a Bogdanov-Takens point.
    plane = np.linalg.svd(a @ a + square * np.eye(len(a)))[2][-2:]
    vector = np.array([0.8, 0.6]) @ np.linalg.svd(a @ plane.T)[2] @ plane
    return np.concatenate([x, vector, [square]])


def slopes(make: MakeOfTwo, x: np.ndarray) -> np.ndarray:
    """(k, k + 1) derivative of the rate with respect to the state and the first parameter."""
    held = WithSecond(make=make, second=jnp.asarray(x[-1]))
    return np.asarray(defining.slope_at(held, x[:-1]))


def _rows(kind: Kind, make: MakeOfTwo, unknowns: np.ndarray, size: int) -> np.ndarray:
    k = size - 2
    v = unknowns[size : size + k] / np.linalg.norm(unknowns[size : size + k])
    if kind == Kind.FOLD:
        return v[None]
    a = slopes(make, unknowns[:size])[:, :-1]
    plane = np.linalg.svd(a @ a + unknowns[-1] * np.eye(k))[2][-2:]
    within = plane @ v
    across = np.array([-within[1], within[0]]) @ plane
    return np.stack([v, across / np.linalg.norm(across)])
