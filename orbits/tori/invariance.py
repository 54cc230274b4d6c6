"""The equations of an invariant circle of the map over a time T, and Newton's method for them.

A torus of two frequencies contains a circle u(theta) on which the map phi over one of its periods T
is a rotation by rho:

    phi(u(theta)) = u(theta + rho)

(Gomez & Mondelo 2001; Olikara & Scheeres 2012). The unknowns are the points u at N angles, rho, and
T unless it is the period of a drive. The circle may be shifted in theta and, without a drive, along
the flow; a torus has neighbours of other amplitude and energy. One condition for each of these
directions singles a circle out.

With damping a torus has such neighbours only for other values of a parameter of the scene, which is
then an unknown too.

Equations, unknowns and lengths are in the units of `Metric`.
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.analysis.energy import energy
from jaxdyn.continuation import newton
from jaxdyn.system import differences
from orbits.closing.given import beside, drive
from orbits.closing.sizes import alike, sizes
from orbits.shooting.segment import LinearizedEnd, Make, Piece, linearize_end, scene_of
from orbits.tori import circle

_STEPS = 15
_DIVERGED = 100.0  # growth of the residual in one step above which no solution is nearby


class Unknowns(NamedTuple):
    """A circle with its rotation and return time, as Newton's method changes them.

    Attributes:
      points: (N, k) states at equally spaced angles.
      rotation: rho [rad].
      time: T [time of the scene].
      parameter: the parameter of the scene; 0 without one.
    """

    points: np.ndarray
    rotation: float = 0.0
    time: float = 0.0
    parameter: float = 0.0

    def pack(self) -> np.ndarray:
        """(N k + 3,) all unknowns as one vector."""
        return np.concatenate([self.points.ravel(), self[1:]])

    def after(self, step: np.ndarray) -> "Unknowns":
        """The unknowns after a step (N k + 3,)."""
        points = self.points + step[:-3].reshape(self.points.shape)
        return Unknowns(points, *(a + float(b) for a, b in zip(self[1:], step[-3:], strict=True)))

    def resample(self, n: int) -> "Unknowns":
        """The same circle with n points."""
        return self._replace(points=circle.resample(self.points, n))


class Flow(NamedTuple):
    """The motions of a scene, or of the scenes of a parameter.

    Attributes:
      scene: the scene, which starts at an orbit inside of the torus and spans its period.
      make: the scene for each value of the parameter; None without one.
      rtol: tolerance of the integrations.
    """

    scene: Scene
    make: Make | None
    rtol: float

    def ends(self, starts: np.ndarray, now: Unknowns) -> LinearizedEnd:
        """The states (N, k) after the time T, and their derivatives.

        Angles are taken in the turn nearest to their start. States are NaN where a motion ends.
        """
        scene, rtol, make = self.scene, self.rtol, self.make
        done = [
            linearize_end(scene, Piece(y, 0.0, now.time, now.parameter), rtol, make=make)
            for y in starts
        ]
        found = jax.tree.map(lambda *leaves: np.stack(leaves), *done)
        return found._replace(y1=starts + np.asarray(differences(scene.system, found.y1, starts)))

    def drive(self, now: Unknowns) -> tuple[np.ndarray, np.ndarray]:
        """(r,) numbers that are 0 if T is a period of the drive, and their derivatives (r, 2).

        The derivatives are those with respect to T and the parameter.
        """
        at, away = np.array([now.time, now.parameter]), beside(self.scene)
        value, slope = _drive(self.scene, at, away, make=self.make)
        return np.asarray(value), np.asarray(slope)


@functools.partial(jax.jit, static_argnames="make")
def _drive(scene: Scene, at, away, *, make: Make | None):
    def change(at):
        return drive(scene_of(scene, make, at[1]), scene.y0, at[0], away)

    return value_and_jacfwd(change)(at)


class Metric(NamedTuple):
    """Units of the entries of a state, time and parameter; lengths of circles with all unknowns.

    Attributes:
      each: (k,) units of the entries.
      time: unit of time.
      parameter: unit of the parameter.
    """

    each: np.ndarray
    time: float
    parameter: float = 1.0

    @classmethod
    def of(cls, scene: Scene, near: Unknowns, parameter: float) -> "Metric":
        """The sizes of the entries along the orbit of a scene, or near it, and a radian of time."""
        most = np.abs(near.points).max(axis=0)
        each = alike(scene, np.maximum(sizes(scene), most))
        return cls(each, near.time / (2 * math.pi), parameter)

    @property
    def _numbers(self) -> np.ndarray:
        """(3,) the units of the unknowns other than the points."""
        return np.array([1.0, self.time, self.parameter])

    def pack(self, n: int) -> np.ndarray:
        """(n k + 3,) the units of unknowns with n points."""
        return np.append(np.tile(self.each, n), self._numbers)

    def row(self, tangent: Unknowns) -> np.ndarray:
        """(N k + 3,) half the inner product of coordinates with those of a tangent, as a row."""
        along = tangent.points / self.each**2 / len(tangent.points)
        return np.append(along.ravel(), np.array(tangent[1:]) / self._numbers**2)

    def coordinates(self, found: Unknowns) -> np.ndarray:
        """(N k + 3,) coordinates of unknowns, or of a tangent, as numbers without units.

        The distance of two circles about one centre is that of their harmonics.
        """
        each = found.points / self.each * math.sqrt(2 / len(found.points))
        return np.append(each.ravel(), math.sqrt(2) * np.array(found[1:]) / self._numbers)

    def unknowns(self, x: np.ndarray) -> Unknowns:
        """The unknowns with coordinates x (N k + 3,)."""
        points = x[:-3].reshape(-1, len(self.each))
        each = self.each / math.sqrt(2 / len(points))
        return Unknowns(points * each, *(x[-3:] / math.sqrt(2) * self._numbers).tolist())

    def norm(self, w: np.ndarray) -> float:
        """The norm of a direction (k,)."""
        return float(np.linalg.norm(w / self.each))


class Conditions(NamedTuple):
    """The conditions that single out a circle among those that satisfy the invariance equation.

    Attributes:
      rows: (c, N k + 3) rows of the linear conditions rows @ unknowns = values, in units.
      values: (c,) right-hand sides of these conditions, in units.
      energy: the mean energy of the points; None where it is not prescribed.
      in_step: whether T is to be a period of the drive, which may change with the parameter.
    """

    rows: np.ndarray
    values: np.ndarray
    energy: float | None = None
    in_step: bool = False


class Solved(NamedTuple):
    """Where Newton's method ended.

    Attributes:
      unknowns: the circle, or the best iterate.
      residual: largest entry of the invariance equation there, in units; NaN if a motion could not
        be integrated.
    """

    unknowns: Unknowns
    residual: float


def solve(flow: Flow, start: Unknowns, conditions: Conditions, metric: Metric) -> Solved:
    """The invariant circle near a start, by Newton's method with the exact Jacobian."""
    units = metric.pack(len(start.points))

    def equations(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _equations(flow, start.after(units * x), conditions, metric)

    # Equations that integrals make dependent are consistent, so the shortest step solves them all.
    rank = np.finfo(float).eps * units.size
    nowhere = np.zeros(units.size)
    found = newton.solve(equations, nowhere, steps=_STEPS, rank=rank, diverged=_DIVERGED)
    return Solved(start.after(units * found.x), found.residual)


def error(flow: Flow, found: Unknowns, metric: Metric) -> tuple[float, float]:
    """The largest error of invariance between the points, and the part that rounding may cause.

    Between the points the equation was not imposed.
    """
    n = len(found.points)
    theta = circle.angles(n) + math.pi / n
    starts = circle.at(found.points, theta)
    ends = flow.ends(starts, found)
    off = ends.y1 - circle.at(found.points, theta + found.rotation)
    by_start = np.abs(ends.slopes.start)
    rounded = np.einsum("nij,nj->ni", by_start, np.finfo(float).eps * np.abs(starts))
    return float(np.abs(off / metric.each).max()), float((rounded / metric.each).max())


def _equations(
    flow: Flow, now: Unknowns, conditions: Conditions, metric: Metric
) -> tuple[np.ndarray, np.ndarray]:
    """Residual and Jacobian of the invariance equation and the conditions, all in units."""
    values, slopes = _invariance(flow, now)
    units = metric.pack(len(now.points))
    # The equations of one point have the units of its entries.
    equations = [(values / units[:-3], slopes / units[:-3, None] * units)]
    fixed = conditions.rows @ now.pack() - conditions.values
    equations.append((fixed, conditions.rows * units))
    if conditions.energy is not None:
        equations.append(_energy(flow.scene, now, conditions.energy, metric))
    if conditions.in_step:
        value, slope = flow.drive(now)
        others = np.zeros((len(value), len(units) - 2))
        equations.append((value, np.concatenate([others, slope * units[-2:]], axis=1)))
    residuals, jacobians = zip(*equations, strict=True)
    return np.concatenate(residuals), np.concatenate(jacobians)


def _invariance(flow: Flow, now: Unknowns) -> tuple[np.ndarray, np.ndarray]:
    """The error (N k,) of the invariance equation at the points, and its Jacobian."""
    points = now.points
    n, k = points.shape
    ends = flow.ends(points, now)
    back, slope = circle.rotation(n, circle.angles(n) - now.rotation)
    middle = points.mean(axis=0)  # see `circle.at`
    value = back @ (ends.y1 - middle) - (points - middle)
    by_points = np.einsum("ij,jab->iajb", back, ends.slopes.start).reshape(n * k, n * k)
    others = [-slope @ (ends.y1 - middle), back @ ends.slopes.span, back @ ends.slopes.parameter]
    columns = [by_points - np.eye(n * k), *(x.reshape(-1, 1) for x in others)]
    return value.ravel(), np.concatenate(columns, axis=1)


def _energy(
    scene: Scene, now: Unknowns, wanted: float, metric: Metric
) -> tuple[np.ndarray, np.ndarray]:
    """The error (1,) of the mean energy, and its Jacobian, in units."""
    value, gradient = mean_energy(scene, now.points)
    change = Unknowns(gradient * metric.each).pack()
    # The unit is the change of the energy when the entries change by their sizes.
    unit = math.sqrt(len(now.points)) * float(np.linalg.norm(change)) or 1.0
    return np.array([(value - wanted) / unit]), change[None] / unit


def mean_energy(scene: Scene, points: np.ndarray) -> tuple[float, np.ndarray]:
    """The mean energy of points (N, k), and its gradient (N, k)."""
    value, gradient = _mean_energy(scene, points)
    return float(value), np.asarray(gradient)


@jax.jit
def _mean_energy(scene: Scene, points):
    def mean(points):
        return jnp.mean(jax.vmap(lambda y: energy(scene, 0.0, y))(points))

    return jax.value_and_grad(mean)(points)


@jax.jit
def rates(scene: Scene, points):
    """(n, k) rates at states (n, k) at time 0."""
    return jax.vmap(lambda y: scene.rate(0.0, y))(points)
