"""The surface of solutions of an orbit's closing equations: its directions, and steps on it.

Near a regular orbit the surface has one direction along the family, and further ones that leave the
orbit the same: one for a shift in time, and one for each symmetry of the scene.
"""

import abc
import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status
from orbits.analysis.monodromy import Segments
from orbits.analysis.stability import Stability, judge
from orbits.families.sizes import unknown_sizes
from orbits.orbit import Orbit, Outcome
from orbits.shooting import newton, trivial
from orbits.shooting.collocation import STEP_SHARE, on_mesh, quality, refine
from orbits.shooting.equations import (
    Equations,
    InUnits,
    Units,
    UnknownSizes,
    units_at,
    units_of_unknowns,
)
from orbits.shooting.outcomes import is_determined, orbit_at
from orbits.shooting.segment import MAX_STEPS, UNTIMED, Limits
from orbits.shooting.segmentation import recut

_CORRECTIONS = 8  # most Newton steps of the corrector; more mean that the step was too long
#: Singular values below this share of the largest belong to directions of the surface. For starts
#: in a close passage the largest is so large that other regular ones are small beside it.
_KERNEL = 1e-9
_NEUTRAL = 1e-6  # relative change of the closing equations up to which a direction is a symmetry
#: Largest number of decimal digits lost over a period at which one run gives the multipliers.
_FEW_DIGITS = 4.0
_AT_REST = 1e-9  # radius, in sizes, of an orbit that is an equilibrium to rounding
#: The corrector ends an integration that takes this many times the steps of the last member's whole
#: period: the predicted orbit has left the family, for instance because it meets a body.
_MOST_STEPS = 10
_BRANCH = 1e-3  # relative: one more singular value is below this at a branch point


@dataclasses.dataclass(frozen=True)
class Point:
    """A point of the surface.

    Attributes:
      equations: the closing equations that it solves, in the segments in which it was found.
      x: (n,) unknowns.
      jacobian: (m, n) Jacobian of the closing equations there.
      sizes: (k,) sizes of the entries of the state, from which the units follow (`unknown_sizes`).
      units: (n,) units of the unknowns, in which lengths and angles near the point are measured.
      residual: largest entry of the closing error, or error of a step of collocation.
      iterations: number of Newton steps that led to it.
      growth: largest growth of errors over a segment; NaN if that is not known.
      steps: number of steps of the integrations; 0 if that is not known, or by collocation.
    """

    equations: Any
    x: np.ndarray
    jacobian: np.ndarray
    sizes: np.ndarray
    units: np.ndarray
    residual: float
    iterations: int
    growth: float = math.nan
    steps: int = 0

    def distance(self, x: np.ndarray) -> float:
        """Distance of x (n,) from the point, in units."""
        return float(np.linalg.norm((x - self.x) / self.units))

    def along(self, direction: np.ndarray, x: np.ndarray) -> float:
        """The component of x (n,) less the point along a direction (n,) of unit length here."""
        return float(direction / self.units @ ((x - self.x) / self.units))

    @property
    def place(self) -> np.ndarray:
        """(p,) the unknowns without the states between segments: the same for any segmentation."""
        return self.equations.place(self.x)

    @property
    def size(self) -> float:
        """Length of the unknowns, in units."""
        return float(np.linalg.norm(self.x / self.units))


class Closed(Protocol):
    """Closing equations in units: residual (m,) and Jacobian (m, n) at unknowns not in units.

    Attributes:
      units: the units.
      sizes: (k,) sizes of the entries of the state.
    """

    units: Units
    sizes: np.ndarray

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...


class Surface(abc.ABC):
    """All solutions of closing equations, found to a goal at a tolerance.

    To add a kind of motion, write a subclass whose unknowns x end with the parameter of the family,
    if it has one, and a time.

    Attributes:
      equations: the equations; their `make` is None without a parameter.
      rtol: tolerance of the integrations.
      goal: largest closing error.
      shrinks: whether the orbits may shrink to an equilibrium.
      parts: number of parts of a period, one of which closes the orbit.
    """

    shrinks: bool
    parts: int

    def __init__(self, equations: Any, rtol: float, goal: float):
        self.equations, self.rtol, self.goal = equations, rtol, goal

    @abc.abstractmethod
    def orbit(self, point: Point) -> Any:
        """The orbit at a point."""

    @abc.abstractmethod
    def scene(self, orbit: Any) -> Scene:
        """The scene in which an orbit starts."""

    @abc.abstractmethod
    def stability(self, orbit: Any, point: Point, alike: np.ndarray) -> Stability:
        """The multipliers of the orbit at a point, with directions (n, p) to others of its scene.

        No error is raised where there are none; see `Stability.status`.
        """

    @abc.abstractmethod
    def judge(self, orbit: Any, known: Stability) -> Any:
        """The orbit with the outcome that its known stability implies."""

    def margins(self, orbit: Any) -> np.ndarray:
        """(e,) numbers that change sign where an orbit grazes an event."""
        del orbit
        return np.zeros(0)

    @abc.abstractmethod
    def _closing_in_units(
        self, x: np.ndarray, known: UnknownSizes, limits: Limits = UNTIMED
    ) -> Closed:
        """The equations in the units of the motion at x."""

    @abc.abstractmethod
    def _unknown_sizes(self, x: np.ndarray, least: np.ndarray | float = 0.0) -> UnknownSizes:
        """The units at x (n,), with sizes (k,) of at least `least`."""

    @abc.abstractmethod
    def _units(self, x: np.ndarray, known: UnknownSizes) -> np.ndarray:
        """(n,) the units of the unknowns at x."""

    @abc.abstractmethod
    def _in_units(self, point: Point) -> np.ndarray:
        """(m, n) the Jacobian at a point, in units."""

    @abc.abstractmethod
    def _neutral(self, x, jacobian, in_units: np.ndarray, entry_sizes: np.ndarray) -> np.ndarray:
        """(n, r) orthonormal in units: directions on the surface that leave the orbit the same."""

    def at(self, point: Point) -> "Surface":
        """The same surface, in the segments of a point."""
        del point
        return self

    def recut(self, point: Point) -> "Surface | None":
        """The same surface, in segments that suit a point better; None if there are none."""
        del point
        return None

    def is_equilibrium(self, point: Point) -> bool:
        """Whether a point is an equilibrium, which closes after any period."""
        del point
        return False

    @abc.abstractmethod
    def status(self, x: np.ndarray) -> Status:
        """The status of the integrations at x."""

    def step_error(self, x: np.ndarray) -> float:
        """The largest error of a step of collocation at x, which no closing error shows; else 0."""
        del x
        return 0.0

    @property
    def alternative(self) -> str:
        """How else the family may be followed where the motion or Newton's method fails."""
        return ""

    def _growth(self, closed: Any, x: np.ndarray) -> float:
        """The largest growth of errors over a segment; NaN if that is not known."""
        del closed, x
        return math.nan

    def _steps(self, closed: Any, x: np.ndarray) -> int:
        """The number of steps of the integrations at x; 0 if that is not known."""
        del closed, x
        return 0

    def nearest(
        self, x: np.ndarray, across: np.ndarray | None = None, *, near: Point | None = None
    ) -> Point | None:
        """The solution nearest to x; with `across` (n,), one with the same component along it.

        Lengths are in the units at x, or in those at a point `near` it, whose sizes are then lower
        bounds.
        """
        if near is None:
            known = self._unknown_sizes(x)
        else:
            known = self.unknown_sizes(near)
        most = _MOST_STEPS * near.steps if near is not None and near.steps else MAX_STEPS
        closed = self._closing_in_units(x, known, Limits(min(most, MAX_STEPS)))
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
        jacobian = result.jacobian[: len(units.residual)] * units.residual[:, None] / units.x
        residual = float(np.abs(result.residual).max(initial=0.0))
        residual = max(residual, self.step_error(result.x))
        if not residual <= self.goal:
            return None
        here = self._unknown_sizes(result.x, 0.0 if near is None else near.sizes)
        return Point(
            equations=self.equations,
            x=result.x,
            jacobian=jacobian,
            sizes=here.sizes,
            units=self._units(result.x, here),
            residual=residual,
            iterations=result.iterations,
            growth=self._growth(closed, result.x),
            steps=self._steps(closed, result.x),
        )

    def point(
        self, x: np.ndarray, residual: float, iterations: int, least: np.ndarray | float = 0.0
    ) -> Point:
        """The point at x (n,), which is known to be a solution; its Jacobian is NaN.

        Its sizes (k,) are at least `least`.
        """
        jacobian, here = np.full((1, x.size), np.nan), self._unknown_sizes(x, least)
        return Point(
            self.equations, x, jacobian, here.sizes, self._units(x, here), residual, iterations
        )

    def directions(self, point: Point) -> np.ndarray:
        """(n, d) orthonormal in units: directions along the surface that change the orbit."""
        jacobian = self._in_units(point)
        _, s, vt = np.linalg.svd(jacobian)
        kernel = vt[int((s > _KERNEL * s[0]).sum()) :].T
        known = self._neutral(point.x, jacobian, point.units, point.sizes)
        u, s, _ = np.linalg.svd(kernel - known @ (known.T @ kernel), full_matrices=False)
        return u[:, s > 0.5]  # directions of the kernel are known ones or orthogonal to them

    def neutral(self, point: Point) -> np.ndarray:
        """(n, r) orthonormal in units: directions on the surface that leave the orbit the same."""
        return self._neutral(point.x, self._in_units(point), point.units, point.sizes)

    def unknown_sizes(self, point: Point) -> UnknownSizes:
        """The sizes from which the units of a point follow."""
        parameter = 1.0 if self.equations.make is None else float(point.units[-2])
        return UnknownSizes(point.sizes, parameter)

    def bordered_determinant(self, point: Point, along: np.ndarray) -> float:
        """The determinant of the equations bordered by the known directions, 0 at a crossing.

        NaN if the bordered matrix is not square, as where an integral of the scene makes some of
        the equations redundant.

        Args:
          point: a point of the surface.
          along: (n,) the direction of its family.
        """
        jacobian = self._in_units(point)
        ahead = along / point.units
        known = np.column_stack([self.neutral(point), ahead / np.linalg.norm(ahead)])
        bordered = np.vstack([jacobian / np.linalg.norm(jacobian, 2), known.T])
        square = len(bordered) == bordered.shape[1]
        return float(np.linalg.det(bordered)) if square else math.nan

    def other_direction(
        self, x: np.ndarray, along: np.ndarray, sizes: np.ndarray
    ) -> np.ndarray | None:
        """(n,) the other direction at a simple branch point, of unit length; None if there is none.

        Args:
          x: (n,) the branch point.
          along: (n,) the direction of the known branch.
          sizes: (k,) lower bounds of the sizes: an entry that differs from 0 only on the bent
            branch of a pitchfork is rounding at the point.
        """
        gap, direction = self.crossing(x, along, sizes)
        return direction if gap < _BRANCH else None

    def crossing(
        self, x: np.ndarray, along: np.ndarray, sizes: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Distance of x from a crossing of families, and (n,) the direction of the other family.

        The arguments are those of `other_direction`. The distance is the smallest singular value of
        the linearised equations with the known directions, relative to the largest one; NaN where
        they have no derivative.
        """
        closed = self._closing_in_units(x, self._unknown_sizes(x, sizes))
        (_, jacobian), units = closed(x), closed.units.x
        if not (np.isfinite(jacobian).all() and np.isfinite(along).all()):
            return math.nan, np.full(len(x), np.nan)
        ahead = along / units / np.linalg.norm(along / units)
        known = np.column_stack([self._neutral(x, jacobian, units, closed.sizes), ahead])
        _, s, vt = np.linalg.svd(np.vstack([jacobian, np.linalg.norm(jacobian) * known.T]))
        return float(s[-1] / s[0]), units * vt[-1]


class OrbitSurface(Surface):
    """All solutions of the closing equations of orbits."""

    equations: Equations

    def __init__(self, equations: Equations, rtol: float, goal: float):
        super().__init__(equations, rtol, goal)
        self.shrinks, self.parts = not equations.driven, equations.closing.parts
        self._symmetries: tuple[str, ...] | None = None

    def orbit(self, point: Point) -> Orbit:
        return orbit_at(
            self.equations,
            point.x,
            residual=point.residual,
            outcome=Outcome.FOUND,
            iterations=point.iterations,
            rtol=self.rtol,
        )

    def at(self, point: Point) -> "OrbitSurface":
        return self if point.equations is self.equations else self._with_cuts(point.equations)

    def recut(self, point: Point) -> "OrbitSurface | None":
        if point.equations.collocated:
            mesh = refine(point.equations, point.x, STEP_SHARE * self.goal)
            cuts = None if mesh is None else on_mesh(point.equations, mesh)
        else:
            cuts = recut(point.equations, point.x, self.rtol, point.sizes, point.growth)
        return None if cuts is None else self._with_cuts(cuts)

    def _with_cuts(self, equations: Equations) -> "OrbitSurface":
        same = OrbitSurface(equations, self.rtol, self.goal)
        same._symmetries = self._symmetries
        return same

    def is_equilibrium(self, point: Point) -> bool:
        equations = self.equations
        if equations.driven:
            return False
        scene = equations.scene_at(equations.unpack(point.x).parameter)
        flow = np.asarray(scene.rate(0.0, equations.start_at(point.x)))
        radius = flow / point.sizes * point.x[-1] / (2 * np.pi)
        return bool(np.abs(radius).max() < _AT_REST)

    def status(self, x: np.ndarray) -> Status:
        return Status(int(self.equations(x, self.rtol).status))

    def step_error(self, x: np.ndarray) -> float:
        if not self.equations.collocated:
            return 0.0
        return float(quality(self.equations, x).errors.max())

    @property
    def alternative(self) -> str:
        if self.equations.collocated:
            return ""
        return "from an orbit found with strategy=orbits.Collocation() the family may go further"

    def _growth(self, closed: InUnits, x: np.ndarray) -> float:
        return max(float(np.linalg.norm(one)) for one in closed.transitions(x))

    def scene(self, orbit: Orbit) -> Scene:
        return orbit.scene

    def stability(self, orbit: Orbit, point: Point, alike: np.ndarray) -> Stability:
        along = np.asarray(_start_slope(self.equations, point.x)) @ alike
        # Errors grow by at most `point.growth` over each segment.
        lost = self.parts * self.equations.segments * math.log10(max(1.0, point.growth))
        alone = self.equations.collocated or lost <= _FEW_DIGITS
        segments = None if alone else Segments(point.equations, point.x, self.rtol)
        return judge(orbit, segments, point.sizes, rtol=orbit.rtol, along=along, throw=False)

    def judge(self, orbit: Orbit, known: Stability) -> Orbit:
        lost = math.log10(max(1.0, known.growth)) if known.ok else math.inf
        outcome = Outcome.FOUND if is_determined(orbit, lost) else Outcome.UNDETERMINED
        return dataclasses.replace(orbit, outcome=outcome)

    def _steps(self, closed: InUnits, x: np.ndarray) -> int:
        return closed.steps(x)

    def _closing_in_units(
        self, x: np.ndarray, known: UnknownSizes, limits: Limits = UNTIMED
    ) -> InUnits:
        return InUnits(self.equations, x, self.rtol, limits, known)

    def _unknown_sizes(self, x: np.ndarray, least: np.ndarray | float = 0.0) -> UnknownSizes:
        return unknown_sizes(self.equations, x, least)

    def _units(self, x: np.ndarray, known: UnknownSizes) -> np.ndarray:
        return units_of_unknowns(self.equations, x, known)

    def _in_units(self, point: Point) -> np.ndarray:
        known = self.unknown_sizes(point)
        return units_at(self.equations, point.x, point.jacobian, known).jacobian(point.jacobian)

    def _neutral(self, x, jacobian, in_units: np.ndarray, entry_sizes: np.ndarray) -> np.ndarray:
        equations, unknowns = self.equations, self.equations.unpack(x)
        scene = equations.scene_at(unknowns.parameter)
        scene = scene.starting(equations.start_at(x), unknowns.period)
        columns = []
        if self._symmetries is None:
            # They are looked for once: a family has those of its first member, and a symmetry that
            # it loses later is no direction of the surface there.
            self._symmetries = tuple(trivial.symmetries(scene, entry_sizes))
        for name in self._symmetries:
            states = [scene.y0, *jnp.asarray(unknowns.between)]
            first, *between = (np.asarray(_field(scene, y, name=name)) for y in states)
            columns.append(equations.pack(first, between, 0.0, 0.0, 0.0) / in_units)
        # Not every symmetry of the scene is a symmetry of the closing condition.
        return kept_directions(jacobian, columns)


def kept_directions(jacobian: np.ndarray, columns: Sequence[np.ndarray]) -> np.ndarray:
    """(n, r) orthonormal basis of those directions (n,), in units, along which the equations hold.

    For independent directions it is the basis nearest to them, their polar factor. That is
    continuous along a family, while singular vectors may change their orientation.
    """
    kept = [np.zeros((jacobian.shape[1], 0))]
    for column in columns:
        size = np.linalg.norm(column)
        if np.linalg.norm(jacobian @ column) <= _NEUTRAL * np.linalg.norm(jacobian) * size > 0:
            kept.append(column[:, None] / size)
    u, s, vt = np.linalg.svd(np.hstack(kept), full_matrices=False)
    independent = s > _NEUTRAL
    return u @ vt if independent.all() else u[:, independent]


@jax.jit
def _start_slope(equations: Equations, x: Array) -> Array:
    return jax.jacfwd(equations.start)(x)


def _field(scene, y, *, name: str):
    return scene.rate(0.0, y) if name == "flow" else trivial.directions(scene, y)[name]
