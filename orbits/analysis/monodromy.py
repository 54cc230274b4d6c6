"""The monodromy matrix of an orbit, rotated back for a relative orbit.

It comes from one run over the period, or from segments that join: where errors grow strongly, a run
leaves the orbit, and its matrix is that of another motion.
"""

import dataclasses
import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status, System
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.analysis.monodromy import monodromy as monodromy
from jaxdyn.analysis.monodromy import tangents as tangents
from orbits.closing.closings import PLAIN, Closing, Symmetry
from orbits.closing.given import has_constraints
from orbits.motion import quick_solve
from orbits.orbit import CLOSED, Orbit, gap
from orbits.shooting import newton
from orbits.shooting.equations import Equations, InUnits, pieces
from orbits.shooting.gauss_steps import NODES, linearize_steps
from orbits.shooting.segment import Piece, linearize_end
from orbits.shooting.segmentation import cut_into_segments

_SAMPLES = 1024  # samples of a period, for the mean of the divergence
_ROUNDING = 1e-12  # rounding error of that mean, relative to its size
_FEWER = 2  # how many fewer nodes give a second opinion on an orbit by collocation
#: Most Newton steps towards segments that join, and the error at which they count as joined; the
#: iteration continues to the rounding level.
_STEPS, _JOINED = 8, 1e-9
_SAME = 1e-8  # how far, in sizes, the start and the period may move in these steps


class Segments(NamedTuple):
    """An orbit in segments that join.

    Attributes:
      equations: its closing equations.
      x: (n,) the unknowns.
      rtol: tolerance of the integrations at which they join.
    """

    equations: Equations
    x: np.ndarray
    rtol: float

    @classmethod
    def of(cls, orbit: Orbit) -> "Segments | None":
        """Segments of an orbit in which errors grow little; None if none are found that join."""
        guess, rtol = np.append(np.asarray(orbit.y0), orbit.period), orbit.rtol
        cuts = cut_into_segments(Equations.of(orbit), guess, rtol, None, orbit.angle)
        return cls(cuts, cuts.spread(guess[:-1], guess[-1], rtol, orbit.angle), math.nan).at(rtol)

    def at(self, rtol: float) -> "Segments | None":
        """The segments of the same orbit at another tolerance; None if they do not join."""
        if rtol == self.rtol:
            return self
        equations, x = self.equations, self.x
        closed = InUnits(equations, x, rtol)
        # The states between segments are those of a run that left the orbit; its start is known.
        known, free = np.append(equations.start_at(x), x[-1]), np.append(closed.sizes, x[-1])
        lower, upper = equations.bounds(known - _SAME * free, known + _SAME * free)
        options = {"units": closed.units.x, "goal": _JOINED, "max_iterations": _STEPS}
        found = newton.solve(closed, x, lower=lower, upper=upper, **options)
        return Segments(equations, found.x, rtol) if found.converged else None

    def monodromy(self, basis: np.ndarray, entry_sizes: np.ndarray) -> "Returned":
        """The monodromy matrix from these segments."""
        equations, unknowns = self.equations, self.equations.unpack(self.x)
        closing, system = equations.closing, equations.scene_at(unknowns.parameter).system
        here, times = jax.tree.map(np.asarray, pieces(equations, self.x)), closing.parts
        found = equations.pass_segments(here, self.rtol)
        ends, status, starts, maps = found.y1, found.status, here.start, found.slopes.start
        maps = np.asarray(maps)
        if closing.mirror is not None:
            again = _mirror_image(here, ends[-1], closing.mirror, equations.driven)
            more = equations.pass_segments(again, self.rtol)
            starts, ends = np.concatenate([starts, again.start]), np.concatenate([ends, more.y1])
            status = np.append(status, more.status)
            maps = np.concatenate([maps, more.slopes.start])
            times = times // 2
        image, back = _image(closing, system, jnp.asarray(ends[-1]), unknowns.angle)
        if type(system).difference is not System.difference:  # its derivative is the unit matrix
            targets = np.concatenate([starts[1:], starts[:1]])
            reached = np.concatenate([ends[:-1], np.asarray(image)[None]])
            *joints, last = np.asarray(_displacements(system, reached, targets))
            maps[:-1], back = np.reshape(joints, maps[:-1].shape) @ maps[:-1], last @ back
        once = functools.reduce(lambda m, step: step @ m, [*maps, np.asarray(back)])
        m = np.linalg.matrix_power(map_in_units(once, entry_sizes), times)
        known = type(system).project is System.project
        growth = times * float(np.linalg.slogdet(maps)[1].sum()) if known else math.nan
        return Returned(basis.T @ m @ basis, _status(m, status.max()), growth)


def _mirror_image(here: Piece, end: np.ndarray, mirror: Symmetry, driven: bool) -> Piece:
    """The n segments of the next part of a motion, which retraces these in reversed time."""
    starts = np.concatenate([end[None], here.start[:0:-1]])
    later = 2 * float(np.sum(here.span)) - (here.t0 + here.span)[::-1]
    return Piece(
        start=np.stack([mirror.act(y) for y in starts]),
        t0=later if driven else here.t0,
        span=here.span[::-1],
        parameter=here.parameter,
        s=None if here.s is None else here.s[::-1],
    )


@jax.jit
def _image(closing: Closing, system: System, end: Array, angle) -> tuple[Array, Array]:
    """(k,) the start whose image is an end, and (k, k) its derivative with respect to the end."""

    def back(y: Array) -> Array:
        return closing.back(system, y, angle)

    return back(end), jax.jacfwd(back)(end)


@jax.jit
def _displacements(system: System, ends: Array, starts: Array) -> Array:
    """(n, k, k) derivatives, with respect to ends (n, k), of their displacements from starts."""
    return jax.vmap(jax.jacfwd(system.difference))(ends, starts)


class Returned(NamedTuple):
    """A monodromy matrix.

    Attributes:
      m: (d, d) the matrix in a basis of tangents, in units of sizes; NaN unless the status is OK.
      status: status of the integration over the period.
      log_determinant: logarithm of the determinant, from segments without constraints; else NaN.
      gap: by how much the end of a run misses the start, in sizes; 0 for segments, which join.
    """

    m: np.ndarray
    status: Status
    log_determinant: float = math.nan
    gap: float = 0.0

    @property
    def closes(self) -> bool:
        """Whether the run ends near its start."""
        return self.gap <= CLOSED

    @property
    def error(self) -> float:
        """The error, relative to its norm, of taking the matrix for that of the orbit.

        A run that misses its start by a gap has the matrix of a motion that far from the orbit.
        """
        return self.gap if self.closes else 1.0


def tangents_in(scene: Scene, entry_sizes: np.ndarray) -> np.ndarray:
    """(k, d) an orthonormal basis of the `tangents` at the start, in units of the sizes (k,)."""
    return np.linalg.qr(tangents(scene, np.asarray(scene.y0)) / entry_sizes[:, None])[0]


def return_in_basis(orbit: Orbit, rtol, basis: np.ndarray, entry_sizes: np.ndarray) -> Returned:
    """The monodromy matrix by one run over the period, rotated back for a relative orbit.

    The basis (k, d) is one of states in units of the sizes (k,).

    The displacement after a period is measured by the system's `difference`, since a quaternion
    and its negative are the same attitude.
    """
    m, status, end = _run(orbit, rtol)
    m = basis.T @ map_in_units(np.asarray(m), entry_sizes) @ basis
    return Returned(m, _status(m, status), gap=gap(orbit, end, entry_sizes=entry_sizes))


def _status(m: np.ndarray, status) -> Status:
    code = Status(int(status))
    return code if np.isfinite(m).all() or code != Status.OK else Status.NOT_FINITE


def return_map(orbit: Orbit, rtol) -> tuple[Array, Array]:
    """(k, k) the monodromy matrix, rotated back for a relative orbit, and its `Status` code.

    The matrix is differentiable in the numbers of the orbit's scene.
    """
    return _run(orbit, rtol)[:2]


def _run(orbit: Orbit, rtol) -> tuple[Array, Array, Array]:
    """`return_map`, and the end of the period."""
    scene, closing = orbit.scene, orbit.closing
    if orbit.mesh is not None:
        end, status, m = _by_collocation(orbit, rtol)
    else:
        whole = Piece(start=scene.y0, t0=0.0, span=scene.t1, parameter=0.0, s=orbit.s_period)
        found = linearize_end(scene, whole, rtol)
        end, status, m = found.y1, found.status, found.slopes.start
    plain = type(scene.system).difference is System.difference  # its derivative is the unit matrix
    m = m if plain else _displacement(orbit, end) @ m
    # The inverse rotation is exact to rounding, so nothing is solved.
    return (rotation_back(orbit) @ m if closing.turns else m), status, end


def log_determinant(orbit: Orbit) -> tuple[float, float]:
    """The logarithm of the monodromy matrix's determinant, and its error; NaN if it is not known.

    By Liouville's theorem it is the integral of the divergence of the rate, which can be computed
    however unstable the motion is. The state must not be constrained.
    """
    scene = orbit.scene
    if has_constraints(scene):
        return math.nan, math.nan
    ts = np.arange(_SAMPLES) * orbit.period / _SAMPLES
    flow = quick_solve(scene, orbit.period, ts=ts, rtol=orbit.rtol, solver=orbit.solver)
    found = np.asarray(_divergences(scene, jnp.asarray(ts), flow.ys))
    # Means over evenly spaced times converge fast; the mean over every other time shows the error.
    whole, half = (float(orbit.period * x.mean()) for x in (found, found[::2]))
    return whole, abs(whole - half) + _ROUNDING * float(orbit.period * np.abs(found).max())


@jax.jit
def _divergences(scene: Scene, ts: Array, ys: Array) -> Array:
    """(s,) the divergence of the rate at times and states (s, k)."""
    return jax.vmap(lambda t, y: jnp.trace(jax.jacfwd(scene.rate, argnums=1)(t, y)))(ts, ys)


def _by_collocation(orbit: Orbit, rtol) -> tuple[Array, Array, Array]:
    """End, status and derivative, by steps over the mesh; a coarser tolerance means fewer nodes."""
    parts = orbit.closing.parts
    one = Equations.of(orbit)
    shares = tuple(np.tile(one.shares, parts) / parts)
    whole = dataclasses.replace(one, closing=PLAIN, shares=shares)
    x = whole.spread(orbit.y0, orbit.period, orbit.rtol)
    here = pieces(whole, x)
    nodes = NODES if rtol <= orbit.rtol else NODES - _FEWER
    found, slopes = linearize_steps(orbit.scene, here, make=None, nodes=nodes)
    m = functools.reduce(lambda m, slope: slope @ m, np.asarray(slopes.start))
    return found.end[-1], found.status.max(), jnp.asarray(m)


@jax.jit
def _displacement(orbit: Orbit, end: Array) -> Array:
    """(k, k) derivative of the displacement after a period with respect to the end."""
    system, y0 = orbit.scene.system, orbit.scene.y0
    # The target only selects the branch of a wrapped angle, or the sign of a quaternion.
    target = jax.lax.stop_gradient(orbit.closing.after(system, y0, orbit.angle, 1))
    return jax.jacfwd(system.difference)(end, target)


@jax.jit
def rotation_back(orbit: Orbit) -> Array:
    """(k, k) derivative of the start of a relative orbit with respect to the end of its period."""
    system, closing = orbit.scene.system, orbit.closing
    return jax.jacfwd(lambda y: closing.after(system, y, orbit.angle, -1))(orbit.scene.y0)
