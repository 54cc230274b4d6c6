"""The equations of an invariant circle of the map over a time T, and Newton's method for them.

A torus of two frequencies contains a circle u(theta) on which the map phi over one of its periods T
is a rotation by rho:

    phi(u(theta)) = u(theta + rho)

(Gomez & Mondelo 2001; Olikara & Scheeres 2012). The unknowns are the points u at N angles, rho, and
T unless it is the period of a drive. The circle may be shifted in theta and, without a drive, along
the flow; a torus has neighbours of other amplitude and energy. One condition for each of these
directions singles a circle out.

Equations, unknowns and lengths are in the units of `Metric`.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene
from jaxdyn.analysis.energy import energy
from jaxdyn.continuation import newton
from jaxdyn.system import differences
from orbits.closing.sizes import alike, sizes
from orbits.shooting.segment import Piece, linearize_end
from orbits.tori import circle

_STEPS = 15
_DIVERGED = 100.0  # growth of the residual in one step above which no solution is nearby


class Unknowns(NamedTuple):
    """A circle with its rotation and return time, as Newton's method changes them.

    Attributes:
      points: (N, k) states at equally spaced angles.
      rotation: rho [rad].
      time: T [time of the scene].
    """

    points: np.ndarray
    rotation: float
    time: float

    def pack(self) -> np.ndarray:
        """(N k + 2,) all unknowns as one vector."""
        return np.concatenate([self.points.ravel(), [self.rotation, self.time]])

    def after(self, step: np.ndarray) -> "Unknowns":
        """The unknowns after a step (N k + 2,)."""
        points = self.points + step[:-2].reshape(self.points.shape)
        return Unknowns(points, self.rotation + float(step[-2]), self.time + float(step[-1]))

    def resample(self, n: int) -> "Unknowns":
        """The same circle with n points."""
        return self._replace(points=circle.resample(self.points, n))


class Metric(NamedTuple):
    """Units of the entries of a state and of time; lengths of circles, their rotations and times.

    Attributes:
      each: (k,) units of the entries.
      time: unit of time.
    """

    each: np.ndarray
    time: float

    @classmethod
    def of(cls, scene: Scene, near: Unknowns) -> "Metric":
        """The sizes of the entries along the orbit of a scene, or near it, and a radian of time."""
        most = np.abs(near.points).max(axis=0)
        return cls(alike(scene, np.maximum(sizes(scene), most)), near.time / (2 * math.pi))

    def pack(self, n: int) -> np.ndarray:
        """(n k + 2,) the units of unknowns with n points."""
        return np.append(np.tile(self.each, n), [1.0, self.time])

    def row(self, tangent: Unknowns) -> np.ndarray:
        """(N k + 2,) half the inner product of coordinates with those of a tangent, as a row."""
        points, rotation, time = tangent
        along = points / self.each**2 / len(points)
        return np.append(along.ravel(), [rotation, time / self.time**2])

    def coordinates(self, found: Unknowns) -> np.ndarray:
        """(N k + 2,) coordinates of unknowns, or of a tangent, as numbers without units.

        The distance of two circles about one centre is that of their harmonics.
        """
        points, rotation, time = found
        each = points / self.each * math.sqrt(2 / len(points))
        return np.append(each.ravel(), [math.sqrt(2) * rotation, math.sqrt(2) * time / self.time])

    def unknowns(self, x: np.ndarray) -> Unknowns:
        """The unknowns with coordinates x (N k + 2,)."""
        points = x[:-2].reshape(-1, len(self.each))
        each = self.each / math.sqrt(2 / len(points))
        rotation, time = (float(z) / math.sqrt(2) for z in x[-2:])
        return Unknowns(points * each, rotation, time * self.time)

    def norm(self, w: np.ndarray) -> float:
        """The norm of a direction (k,)."""
        return float(np.linalg.norm(w / self.each))


class Conditions(NamedTuple):
    """The conditions that single out a circle among those that satisfy the invariance equation.

    Attributes:
      rows: (c, N k + 2) rows of the linear conditions rows @ unknowns = values, in units.
      values: (c,) right-hand sides of these conditions, in units.
      energy: the mean energy of the points; None where it is not prescribed.
    """

    rows: np.ndarray
    values: np.ndarray
    energy: float | None


class Solved(NamedTuple):
    """Where Newton's method ended.

    Attributes:
      unknowns: the circle, or the best iterate.
      residual: largest entry of the invariance equation there, in units; NaN if a motion could not
        be integrated.
    """

    unknowns: Unknowns
    residual: float


def solve(
    scene: Scene, start: Unknowns, conditions: Conditions, rtol: float, metric: Metric
) -> Solved:
    """The invariant circle near a start, by Newton's method with the exact Jacobian."""
    units = metric.pack(len(start.points))

    def equations(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _equations(scene, start.after(units * x), conditions, rtol, metric)

    # Equations that integrals make dependent are consistent, so the shortest step solves them all.
    rank = np.finfo(float).eps * units.size
    nowhere = np.zeros(units.size)
    found = newton.solve(equations, nowhere, steps=_STEPS, rank=rank, diverged=_DIVERGED)
    return Solved(start.after(units * found.x), found.residual)


def error(scene: Scene, found: Unknowns, rtol: float, metric: Metric) -> tuple[float, float]:
    """The largest error of invariance between the points, and the part that rounding may cause.

    Between the points the equation was not imposed.
    """
    n = len(found.points)
    theta = circle.angles(n) + math.pi / n
    starts = circle.at(found.points, theta)
    ends, by_start, _ = flow_map(scene, starts, found.time, rtol)
    off = ends - circle.at(found.points, theta + found.rotation)
    rounded = np.einsum("nij,nj->ni", np.abs(by_start), np.finfo(float).eps * np.abs(starts))
    return float(np.abs(off / metric.each).max()), float((rounded / metric.each).max())


def flow_map(scene: Scene, points: np.ndarray, time: float, rtol: float):
    """States (N, k) after a time, and their derivatives by the start (N, k, k) and time (N, k).

    Angles are taken in the turn nearest to their start. States are NaN where a motion ends.
    """
    done = [
        linearize_end(scene, Piece(start=y, t0=0.0, span=time, parameter=0.0), rtol) for y in points
    ]
    found = jax.tree.map(lambda *leaves: np.stack(leaves), *done)
    ends = points + np.asarray(differences(scene.system, found.y1, points))
    return ends, found.slopes.start, found.slopes.span


def _equations(
    scene: Scene, now: Unknowns, conditions: Conditions, rtol: float, metric: Metric
) -> tuple[np.ndarray, np.ndarray]:
    """Residual and Jacobian of the invariance equation and the conditions, all in units."""
    points, rho, time = now
    n, k = points.shape
    ends, by_start, by_time = flow_map(scene, points, time, rtol)
    back, slope = circle.rotation(n, circle.angles(n) - rho)
    middle = points.mean(axis=0)  # see `circle.at`
    residual = back @ (ends - middle) - (points - middle)
    by_points = np.einsum("ij,jab->iajb", back, by_start).reshape(n * k, n * k) - np.eye(n * k)
    by_rotation = -slope @ (ends - middle)
    columns = [by_points, by_rotation.reshape(-1, 1), (back @ by_time).reshape(-1, 1)]
    jacobian, units = np.concatenate(columns, axis=1), metric.pack(n)
    fixed = conditions.rows @ now.pack() - conditions.values
    residual = np.concatenate([residual.ravel() / units[:-2], fixed])
    jacobian = np.concatenate([jacobian / units[:-2, None], conditions.rows]) * units
    if conditions.energy is None:
        return residual, jacobian
    value, gradient = mean_energy(scene, points)
    change = np.append((gradient * metric.each).ravel(), [0.0, 0.0])
    # The unit is the change of the energy when the entries change by their sizes.
    unit = math.sqrt(n) * float(np.linalg.norm(change)) or 1.0
    return (
        np.append(residual, (value - conditions.energy) / unit),
        np.concatenate([jacobian, change[None] / unit]),
    )


def mean_energy(scene: Scene, points: np.ndarray) -> tuple[float, np.ndarray]:
    """The mean energy of points (N, k), and its gradient (N, k)."""
    value, gradient = _mean_energy(scene, points)
    return float(value), np.asarray(gradient)


@jax.jit
def _mean_energy(scene: Scene, points):
    def mean(points):
        return jnp.mean(jax.vmap(lambda y: energy(scene, 0.0, y))(points))

    return jax.value_and_grad(mean)(points)
