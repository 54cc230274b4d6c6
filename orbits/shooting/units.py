"""Closing equations in the units of a motion: dimensionless unknowns, residual and Jacobian.

Norms, ranks, dampings and goals only mean something for numbers of one kind. So an iteration works
with the unknowns divided by their sizes, and with each equation divided by what it is to be
compared with: an error of closing by the size of its entry, a condition by the change that the
unknowns make in it when each changes by its size.
"""

from typing import NamedTuple

import numpy as np

from jaxdyn.analysis.eigenvalues import map_in_units
from orbits.closing.sizes import PHASES, sizes
from orbits.shooting.equations import Equations, Evaluation
from orbits.shooting.segment import UNTIMED, Limits

#: A value below this share of an entry's size is rounding.
_ROUNDING = 1e-9


class Lengths(NamedTuple):
    """The lengths from which the units of unknowns follow.

    Attributes:
      sizes: (k,) sizes of the entries of the state.
      parameter: the unit of a family's parameter.
    """

    sizes: np.ndarray
    parameter: float = 1.0


class Units(NamedTuple):
    """Units of the unknowns and of the residual.

    Attributes:
      x: (n,) units of the unknowns.
      rows: (m,) units of the residual.
    """

    x: np.ndarray
    rows: np.ndarray

    def jacobian(self, jacobian: np.ndarray) -> np.ndarray:
        """(m, n) a Jacobian in these units."""
        return np.asarray(jacobian) * self.x / self.rows[:, None]


def units_at(equations: Equations, x: np.ndarray, jacobian: np.ndarray, lengths: Lengths) -> Units:
    """The units of the motion at x, where the Jacobian is known."""
    each, x_units = lengths.sizes, units_of_unknowns(equations, x, lengths)
    changes = np.abs(np.where(np.isfinite(jacobian), jacobian, 0.0)) * x_units
    between = np.tile(each, equations.segments - 1)
    rows = np.concatenate([between, equations.closing.rows(each)])
    return Units(x_units, equation_units(equations, rows, changes))


def units_of_unknowns(equations: Equations, x: np.ndarray, lengths: Lengths) -> np.ndarray:
    """(n,) the units of unknowns x (n,); the unit of time is a radian of the period."""
    # The states of all segments count as one.
    each = np.sqrt(equations.segments) * lengths.sizes
    between = np.tile(each, (equations.segments - 1, 1))
    radian = x[-1] / (2 * np.pi)
    return equations.pack(each, between, angle=1.0, parameter=lengths.parameter, period=radian)


def equation_units(equations: Equations, states: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """(m,) the units of equations, the first of which are errors of states with sizes `states`.

    The unit of a condition is the norm of its changes (m, n) when each unknown changes by its unit;
    the equations of a drive, which are the last ones, have unit 1.
    """
    rows = np.linalg.norm(changes, axis=1)
    rows = np.where(rows > 0, rows, 1.0)
    rows[: len(states)] = states
    if equations.driven:
        rows[len(rows) - PHASES * len(equations.scene.y0) :] = 1.0
    return rows


def sizes_at(equations: Equations, x: np.ndarray) -> np.ndarray:
    """(k,) the sizes of the state's entries along the motion at x."""
    unknowns, start = equations.unpack(x), equations.start_at(x)
    known = sizes(equations.scene)
    guess = np.append(equations.scene.y0, equations.scene.t1)
    if equations.make is None and np.array_equal(np.append(start, unknowns.period), guess):
        return known
    scene = equations.scene_at(unknowns.parameter)
    # An entry that rests at 0 in the equations' own scene may be rounding here.
    start = np.where(np.abs(start) > _ROUNDING * known, start, 0.0)
    found = sizes(scene.starting(start, unknowns.period))
    return np.where(found > _ROUNDING * known, found, known)


class InUnits:
    """The closing equations in the units of the motion at a first point, at a tolerance.

    The units follow from the start of that motion, or from lengths that are known.

    Attributes:
      equations: the equations.
      rtol: tolerance of the integrations.
      sizes: (k,) sizes of the entries of the state along that motion.
      units: the units.
    """

    def __init__(
        self,
        equations: Equations,
        x: np.ndarray,
        rtol: float,
        limits: Limits = UNTIMED,
        lengths: Lengths | None = None,
    ):
        self.equations, self.rtol, self._limits = equations, rtol, limits
        self._last = x, equations(x, rtol, limits)
        lengths = lengths or Lengths(sizes_at(equations, x))
        self.sizes = lengths.sizes
        self.units = units_at(equations, x, np.asarray(self._last[1].jacobian), lengths)

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residual (m,) and the Jacobian (m, n), in the units, at x (n,) in its own units.

        An iteration that goes on from the last evaluation does not repeat it.
        """
        found = self._at(x)
        return np.asarray(found.residual) / self.units.rows, self.units.jacobian(found.jacobian)

    def transitions(self, x: np.ndarray) -> np.ndarray:
        """(segments, k, k) derivatives of ends of segments with respect to starts, in the sizes."""
        return map_in_units(np.asarray(self._at(x).transitions), self.sizes)

    def status(self, x: np.ndarray) -> int:
        """The worst `Status` code of the integrations at x."""
        return int(self._at(x).status)

    def _at(self, x: np.ndarray) -> Evaluation:
        if not np.array_equal(x, self._last[0]):
            self._last = x, self.equations(x, self.rtol, self._limits)
        return self._last[1]
