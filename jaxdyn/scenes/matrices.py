"""Linear systems of any kind that are given by their matrices M, C and K."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.effects import CirculatoryForce, MatrixDamper, unless_zero
from jaxdyn.formulations.functions import name_entries
from jaxdyn.formulations.linear import LinearSystem
from jaxdyn.scene import Scene
from jaxdyn.scenes.ready_made import ready_made

#: Largest asymmetry of a matrix, relative to its largest entry, that may be rounding.
_ROUNDING = 1e-12


@ready_made(but=("M", "C", "K", "x", "v"))
def linear_system(
    *,
    M=((1.0, 0.0), (0.0, 1.0)),
    C=((0.0, 0.0), (0.0, 0.0)),
    K=((2.0, -1.0), (-1.0, 2.0)),
    x=0.0,
    v=0.0,
    names: Sequence[str | tuple[str, str]] = (),
    t1=10.0,
) -> Scene:
    """A linear system that is given by its matrices, M q'' + C q' + K q = 0.

    C may contain gyroscopic terms, which are skew-symmetric, and K circulatory ones, which have no
    potential. Forces on the coordinates are added by `vibration.drive`.

    Args:
      M: mass matrix, symmetric and positive definite [kg].
      C: matrix of damping and gyroscopic terms; 0, as by default, leaves it out [kg/s].
      K: stiffness matrix [N/m].
      x: each coordinate at the start, or all of them [m].
      v: velocity of each coordinate at the start, or of all [m/s].
      names: name of each coordinate, in Python also pairs (name, unit); x1, x2, ... in m if left
        out. With the unit "rad" the entries of the matrices are in N m and so on.
      t1: span [s].
    """
    M = _checks.array("M", M, (None, None))
    n = len(M)
    each = "All matrices have a row and a column for each coordinate."
    _checks.check_shape("M", M.shape, (n, n), each)
    C = jnp.zeros((n, n)) if _is_zero(C) else _checks.array("C", C, (n, n), each)
    K = _checks.array("K", K, (n, n), each)
    _, whirling = _parts(K)
    if not _checks.is_traced(M) and np.any(_parts(np.asarray(M))[1]):
        raise _checks.fail("M", "a symmetric matrix", np.asarray(M).tolist(), "T = v^T M v / 2.")
    effects = unless_zero(C, MatrixDamper(C)) + unless_zero(whirling, CirculatoryForce(whirling))
    named = names or [f"x{i + 1}" for i in range(n)]
    pairs = name_entries([(x, "m") if isinstance(x, str) else x for x in named], "x", n)
    y0 = jnp.concatenate([_for_each(name, one, n) for name, one in (("x", x), ("v", v))])
    return Scene(LinearSystem(_parts(M)[0], _parts(K)[0], pairs), effects, y0=y0, t1=t1)


def _parts(x) -> tuple[Array, Array]:
    """The symmetric and the skew-symmetric part of a matrix; the latter is 0 up to rounding."""
    skew = 0.5 * (x - x.T)
    if not _checks.is_traced(x) and np.abs(skew).max() <= _ROUNDING * np.abs(x).max():
        skew = jnp.zeros_like(skew)
    return 0.5 * (x + x.T), skew


def _is_zero(x) -> bool:
    return not _checks.is_traced(x) and not np.any(np.asarray(x))


def _for_each(name: str, x, n: int) -> Array:
    x = _checks.numbers(name, x)
    return jnp.broadcast_to(x, n) if not x.ndim else _checks.array(name, x, (n,))
