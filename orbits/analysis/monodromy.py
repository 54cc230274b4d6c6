"""The monodromy matrix of an orbit, rotated back for a relative orbit."""

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status, System
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.analysis.monodromy import monodromy as monodromy
from jaxdyn.analysis.monodromy import tangents as tangents
from orbits.closing.closings import PLAIN
from orbits.motion import solved
from orbits.orbit import Orbit
from orbits.shooting.collocation.steps import NODES, linearised_steps
from orbits.shooting.equations import Equations, pieces
from orbits.shooting.segment import Piece, linearised_end

_SAMPLES = 1024  # of a period, for the mean of the divergence
_ROUNDING = 1e-12  # of that, relative to its size
_FEWER = 2  # nodes, for a second opinion on an orbit by collocation


def tangents_in(scene: Scene, each: np.ndarray) -> np.ndarray:
    """(k, d) orthonormal basis of `tangents` at the start, in units of sizes `each` (k,)."""
    return np.linalg.qr(tangents(scene, np.asarray(scene.y0)) / each[:, None])[0]


def returned(orbit: Orbit, rtol, basis: np.ndarray, each: np.ndarray) -> tuple[np.ndarray, Status]:
    """(d, d) the monodromy matrix in a basis of tangents, rotated back for a relative orbit.

    The basis (k, d) is one of states in units of sizes `each` (k,).

    The displacement after a period is measured by `difference`: -1 times a quaternion is the
    same attitude. The matrix is NaN unless the status of its integration is OK.
    """
    m, status = returned_map(orbit, rtol)
    m = basis.T @ map_in_units(m, each) @ basis
    code = Status(int(status))
    return m, code if np.isfinite(m).all() or code != Status.OK else Status.NOT_FINITE


def returned_map(orbit: Orbit, rtol) -> tuple[Array, Array]:
    """(k, k) the monodromy matrix, rotated back for a relative orbit, and its `Status` code.

    The matrix is differentiable in the numbers of the orbit's scene.
    """
    scene, closing = orbit.scene, orbit.closing
    if orbit.mesh is not None:
        end, status, m = _by_collocation(orbit, rtol)
    else:
        end, status, m = _by_integration(orbit, rtol)
    plain = type(scene.system).difference is System.difference  # its derivative is the unit matrix
    m = m if plain else _displacement(orbit, end) @ m
    # Not by solving: the inverse rotation is exact to rounding.
    return (rotation_back(orbit) @ m if closing.turns else m), status


def log_determinant(orbit: Orbit) -> tuple[float, float]:
    """The logarithm of the monodromy matrix's determinant, and its error; NaN if it is not known.

    By Liouville's theorem the integral of the divergence of the rate, which is the same however
    much the motion is unstable. The rate must be one of as many entries as degrees of freedom.
    """
    scene = orbit.scene
    if type(scene.system).project is not System.project:
        return math.nan, math.nan
    ts = np.arange(_SAMPLES) * orbit.period / _SAMPLES
    flow = solved(scene, orbit.period, ts=ts, rtol=orbit.rtol, solver=orbit.solver)
    found = np.asarray(_divergences(scene, jnp.asarray(ts), flow.ys))
    # The mean of a smooth periodic function over equal times; half of them show its error.
    whole, half = (float(orbit.period * x.mean()) for x in (found, found[::2]))
    return whole, abs(whole - half) + _ROUNDING * float(orbit.period * np.abs(found).max())


@jax.jit
def _divergences(scene: Scene, ts: Array, ys: Array) -> Array:
    """(s,) the divergence of the rate at times and states (s, k)."""
    return jax.vmap(lambda t, y: jnp.trace(jax.jacfwd(scene.rate, argnums=1)(t, y)))(ts, ys)


def _by_integration(orbit: Orbit, rtol) -> tuple[Array, Array, Array]:
    """The end of the period, the status, and the derivative (k, k) of the end by the start."""
    scene = orbit.scene
    whole = Piece(start=scene.y0, t0=0.0, span=scene.t1, parameter=0.0, s=orbit.s_period)
    end, status, slopes = linearised_end(scene, whole, rtol)
    return end, status, slopes.start


def _by_collocation(orbit: Orbit, rtol) -> tuple[Array, Array, Array]:
    """The same by the steps over the orbit's mesh; at a coarser tolerance with fewer nodes."""
    parts = orbit.closing.parts
    one = Equations.of(orbit)
    shares = tuple(np.tile(one.shares, parts) / parts)
    whole = dataclasses.replace(one, closing=PLAIN, shares=shares)
    x = whole.spread(orbit.y0, orbit.period, orbit.rtol)
    here = pieces(whole, x)
    nodes = NODES if rtol <= orbit.rtol else NODES - _FEWER
    found, slopes = linearised_steps(orbit.scene, here, make=None, nodes=nodes)
    m = functools.reduce(lambda m, slope: slope @ m, np.asarray(slopes.start))
    return found.end[-1], found.status.max(), jnp.asarray(m)


@jax.jit
def _displacement(orbit: Orbit, end: Array) -> Array:
    """(k, k) derivative of the displacement after a period by the end."""
    system, y0 = orbit.scene.system, orbit.scene.y0
    # Only for the branch of a wrapped angle, or the sign of a quaternion.
    target = jax.lax.stop_gradient(orbit.closing.after(system, y0, orbit.angle, 1))
    return jax.jacfwd(system.difference)(end, target)


@jax.jit
def rotation_back(orbit: Orbit) -> Array:
    """(k, k) derivative of the start of a relative orbit by the end of its period."""
    system, closing = orbit.scene.system, orbit.closing
    return jax.jacfwd(lambda y: closing.after(system, y, orbit.angle, -1))(orbit.scene.y0)
