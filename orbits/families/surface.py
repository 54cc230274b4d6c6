"""The surface of solutions of an orbit's closing equations: its directions, and steps on it.

Near a regular orbit it has one direction along the family, and one for each way to move the orbit
without changing it: in time, and by each symmetry of the scene.
"""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from orbits.closing.sizes import rate
from orbits.families.lengths import lengths
from orbits.orbit import Orbit, Outcome
from orbits.shooting import newton, trivial
from orbits.shooting.equations import Equations
from orbits.shooting.outcomes import orbit_at
from orbits.shooting.units import InUnits, Lengths, units_at, units_of_unknowns

_CORRECTIONS = 8  # Newton steps from a predicted point; more mean that the step was too long
#: Relative: singular values below are directions of the surface. Those of starts in a close passage
#: are large, so that others are small beside them.
_KERNEL = 1e-9
_NEUTRAL = 1e-6  # relative: the closing equations change no more along a symmetry of theirs
_AT_REST = 1e-9  # of the sizes: radius of an orbit that is an equilibrium to rounding
_BRANCH = 1e-3  # relative: at a branch point found by bisection one more is below this


@dataclasses.dataclass(frozen=True)
class Point:
    """A point of the surface.

    Attributes:
      equations: the closing equations that it solves, in the segments in which it was found.
      x: (n,) unknowns.
      jacobian: (m, n) of the closing equations there.
      sizes: (k,) of the entries of the state, from which the units follow (`lengths`).
      units: (n,) of the unknowns, in which lengths and angles near the point are measured.
      residual: largest entry of the closing error.
      iterations: number of Newton steps to it.
      growth: the largest of errors over a segment; NaN if that is not known.
    """

    equations: Equations
    x: np.ndarray
    jacobian: np.ndarray
    sizes: np.ndarray
    units: np.ndarray
    residual: float
    iterations: int
    growth: float = math.nan

    def distance(self, x: np.ndarray) -> float:
        """Distance of x (n,)."""
        return float(np.linalg.norm((x - self.x) / self.units))

    def along(self, direction: np.ndarray, x: np.ndarray) -> float:
        """How far x (n,) is along a direction (n,) that has unit length here."""
        return float(direction / self.units @ ((x - self.x) / self.units))

    @property
    def place(self) -> np.ndarray:
        """(p,) the unknowns that points have in whatever segments: all but the states between."""
        start, between = self.equations.unpack(self.x)[:2]
        return np.delete(self.x, slice(start.size, start.size + between.size))

    @property
    def size(self) -> float:
        """Length of the unknowns."""
        return float(np.linalg.norm(self.x / self.units))


class Surface:
    """All solutions of closing equations, found to a goal at a tolerance."""

    def __init__(self, equations: Equations, rtol: float, goal: float):
        self.equations, self.rtol, self.goal = equations, rtol, goal
        self._symmetries: tuple[str, ...] | None = None

    def at(self, point: Point) -> "Surface":
        """The same surface, in the segments of a point."""
        if point.equations is self.equations:
            return self
        same = Surface(point.equations, self.rtol, self.goal)
        same._symmetries = self._symmetries
        return same

    def nearest(
        self, x: np.ndarray, across: np.ndarray | None = None, *, near: Point | None = None
    ) -> Point | None:
        """The solution nearest to x; with `across` (n,), that with x's component along it.

        Lengths are in the units at x, or at a point `near` it, whose sizes are then the least.
        """
        if near is None:
            known = lengths(self.equations, x)
        else:
            known = self.lengths(near)
        closed = InUnits(self.equations, x, self.rtol, lengths=known)
        units = closed.units
        row = None if across is None else across / units.x / np.linalg.norm(across / units.x)

        def evaluated(at):
            residual, jacobian = closed(at)
            if row is not None:
                residual = np.append(residual, row @ ((at - x) / units.x))
                jacobian = np.vstack([jacobian, row])
            return residual, jacobian

        low, high = np.full(len(x), -np.inf), np.full(len(x), np.inf)
        result = newton.solve(
            evaluated,
            x,
            lower=low,
            upper=high,
            goal=self.goal,
            max_iterations=_CORRECTIONS,
            units=units.x,
        )
        if not result.converged:
            return None
        assert result.jacobian is not None
        jacobian = result.jacobian[: len(units.rows)] * units.rows[:, None] / units.x
        residual = float(np.abs(result.residual).max(initial=0.0))
        here = lengths(self.equations, result.x, 0.0 if near is None else near.sizes)
        return Point(
            equations=self.equations,
            x=result.x,
            jacobian=jacobian,
            sizes=here.sizes,
            units=units_of_unknowns(self.equations, result.x, here),
            residual=residual,
            iterations=result.iterations,
            growth=max(np.linalg.norm(one) for one in closed.transitions(result.x)),
        )

    def point(self, x: np.ndarray, residual: float, iterations: int) -> Point:
        """The point at x (n,), which is known to be one; without its Jacobian."""
        jacobian, here = np.full((1, x.size), np.nan), lengths(self.equations, x)
        units = units_of_unknowns(self.equations, x, here)
        return Point(self.equations, x, jacobian, here.sizes, units, residual, iterations)

    def orbit(self, point: Point) -> Orbit:
        """The orbit at a point."""
        return orbit_at(
            self.equations,
            point.x,
            residual=point.residual,
            outcome=Outcome.FOUND,
            iterations=point.iterations,
            rtol=self.rtol,
        )

    def rests(self, point: Point) -> bool:
        """Whether a point is an equilibrium, which closes after any period."""
        equations = self.equations
        if equations.driven:
            return False
        scene = equations.scene_at(equations.unpack(point.x).parameter)
        flow = np.asarray(rate(scene, 0.0, equations.start_at(point.x)))
        radius = flow / point.sizes * point.x[-1] / (2 * np.pi)
        return bool(np.abs(radius).max() < _AT_REST)

    def of_start(self, x: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(k, p) the change of the start along directions (n, p) at x."""
        return np.asarray(_start_slope(self.equations, x)) @ directions

    def directions(self, point: Point) -> np.ndarray:
        """(n, d) orthonormal in units: directions along the surface that change the orbit."""
        jacobian = self._in_units(point)
        _, s, vt = np.linalg.svd(jacobian)
        kernel = vt[int((s > _KERNEL * s[0]).sum()) :].T
        known = self._neutral(point.x, jacobian, point.units, point.sizes)
        u, s, _ = np.linalg.svd(kernel - known @ (known.T @ kernel), full_matrices=False)
        return u[:, s > 0.5]  # each direction of the kernel is known or orthogonal to that

    def neutral(self, point: Point) -> np.ndarray:
        """(n, r) orthonormal in units: directions along the surface that keep the orbit."""
        return self._neutral(point.x, self._in_units(point), point.units, point.sizes)

    def _in_units(self, point: Point) -> np.ndarray:
        known = self.lengths(point)
        return units_at(self.equations, point.x, point.jacobian, known).jacobian(point.jacobian)

    def lengths(self, point: Point) -> Lengths:
        """What the units of a point follow from."""
        parameter = 1.0 if self.equations.make is None else float(point.units[-2])
        return Lengths(point.sizes, parameter)

    def _neutral(self, x, jacobian, in_units: np.ndarray, each: np.ndarray) -> np.ndarray:
        equations, unknowns = self.equations, self.equations.unpack(x)
        scene = equations.scene_at(unknowns.parameter)
        scene = scene.starting(equations.start_at(x), unknowns.period)
        columns = [np.zeros(len(x))]
        if self._symmetries is None:
            # Looked for once: a family has those of its first member, and one that it loses on the
            # way is no direction of the surface there.
            self._symmetries = tuple(trivial.symmetries(scene, each))
        for name in self._symmetries:
            states = [scene.y0, *jnp.asarray(unknowns.between)]
            first, *between = (np.asarray(_field(scene, y, name=name)) for y in states)
            column = equations.pack(first, between, 0.0, 0.0, 0.0) / in_units
            size = np.linalg.norm(column)
            # Not every symmetry of the scene is one of the closing condition.
            if np.linalg.norm(jacobian @ column) <= _NEUTRAL * np.linalg.norm(jacobian) * size > 0:
                columns.append(column / size)
        u, s, _ = np.linalg.svd(np.array(columns).T, full_matrices=False)
        return u[:, s > _NEUTRAL]

    def aside(self, x: np.ndarray, along: np.ndarray) -> np.ndarray | None:
        """(n,) the other direction at a simple branch point, of unit length; None if there is none.

        Args:
          x: (n,) the branch point.
          along: (n,) the direction of the known branch.
        """
        closed = InUnits(self.equations, x, self.rtol, lengths=lengths(self.equations, x))
        (_, jacobian), units = closed(x), closed.units.x
        if not (np.isfinite(jacobian).all() and np.isfinite(along).all()):
            return None
        ahead = along / units / np.linalg.norm(along / units)
        known = np.column_stack([self._neutral(x, jacobian, units, closed.sizes), ahead])
        _, s, vt = np.linalg.svd(np.vstack([jacobian, np.linalg.norm(jacobian) * known.T]))
        return units * vt[-1] if s[-1] < _BRANCH * s[0] else None


@jax.jit
def _start_slope(equations: Equations, x: Array) -> Array:
    return jax.jacfwd(equations.start)(x)


def _field(scene, y, *, name: str):
    return rate(scene, 0.0, y) if name == "flow" else trivial.directions(scene, y)[name]
