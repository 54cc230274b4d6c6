"""The monodromy matrix of an orbit, rotated back for a relative orbit."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status, System
from jaxdyn.analysis.monodromy import monodromy as monodromy
from orbits.motion import advanced
from orbits.orbit import Orbit

_TANGENT = 1e-6  # smaller singular values of a projection's derivative are directions it removes


def tangents(scene: Scene, y0: np.ndarray) -> np.ndarray:
    """Orthonormal basis (k, d) of the states near the start that satisfy the constraints."""
    if type(scene.system).project is System.project:
        return np.eye(len(y0))
    u, s, _ = np.linalg.svd(np.asarray(_projection(scene, jnp.asarray(y0))))
    return u[:, s > _TANGENT]


@jax.jit
def _projection(scene: Scene, y0: Array) -> Array:
    return jax.jacfwd(scene.system.project, argnums=1)(jnp.zeros(()), y0)


def returned(orbit: Orbit, rtol, basis: np.ndarray) -> tuple[np.ndarray, Status]:
    """(d, d) the monodromy matrix in a basis of tangents, rotated back for a relative orbit.

    The displacement after a period is measured by `difference`: -1 times a quaternion is the
    same attitude. The matrix is NaN unless the status of its integration is OK.
    """
    m, status = returned_map(orbit, rtol)
    m = basis.T @ np.asarray(m) @ basis
    code = Status(int(status))
    return m, code if np.isfinite(m).all() or code != Status.OK else Status.NOT_FINITE


@jax.jit
def returned_map(orbit: Orbit, rtol) -> tuple[Array, Array]:
    """(k, k) the monodromy matrix, rotated back for a relative orbit, and its `Status` code.

    The matrix is differentiable in the numbers of the orbit's scene.
    """
    scene, closing, angle = orbit.scene, orbit.closing, orbit.angle

    def end(y):
        flow = advanced(scene.starting(y), scene.t1, orbit.s_period, rtol=rtol)
        return scene.system.difference(flow.y1, target), flow.status

    # Only for the branch of a wrapped angle, or the sign of a quaternion.
    target = jax.lax.stop_gradient(closing.after(scene.system, scene.y0, angle, 1))
    m, status = jax.jacfwd(end, has_aux=True)(scene.y0)
    if not closing.turns:
        return m, status
    # Not by solving: the inverse rotation is exact to rounding.
    back = jax.jacfwd(lambda y: closing.after(scene.system, y, -angle, 1))(scene.y0)
    return jnp.sum(back[:, :, None] * m[None], axis=1), status
