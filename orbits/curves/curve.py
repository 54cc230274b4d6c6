"""The orbits of a curve in two parameters, and the curve itself."""

import dataclasses
import enum
import inspect
import math

import numpy as np

from jaxdyn import _text
from jaxdyn.analysis.eigenvalues import Eigenvalues, with_bars
from orbits.curves.extended import Extended, MakeOfTwo
from orbits.families.family import Kind
from orbits.orbit import Orbit


class CodimensionTwo(enum.StrEnum):
    """A kind of special point of a curve, at which two conditions hold."""

    CUSP = "cusp"
    RESONANCE_1_1 = "1:1 resonance"
    RESONANCE_1_2 = "1:2 resonance"
    RESONANCE_1_3 = "1:3 resonance"
    RESONANCE_1_4 = "1:4 resonance"
    FOLD_FLIP = "fold-flip"
    FOLD_TORUS = "fold-torus point"
    FLIP_TORUS = "flip-torus point"
    DOUBLE_TORUS = "double torus point"


@dataclasses.dataclass(frozen=True)
class CurvePoint:
    """A special orbit of a curve in two parameters.

    Attributes:
      curve: kind of the orbits of the curve.
      orbit: the orbit.
      parameters: (2,) its values of the parameters.
      multipliers: of the map over one part of the period, undone by the symmetry of the closing,
        without the one along the flow; with bars.
      angle: of the critical multipliers of a torus point [rad]; NaN for other kinds.
      residual: largest entry of the residual of the point's equations, in its units, and of the
        condition of its kind at a special point.
      unknowns: (n,) of the equations.
      tangent: (n,) direction of the curve; of unit length in start, period and parameters, in its
        units.
      tests: of each kind of special point a number that vanishes there.
      kind: kind of special point, if it is one.
      units: (k + 3,) of the state's entries, of the parameters and of time (`units`), in which the
        curve is followed. None in a file of an earlier version.
    """

    curve: Kind
    orbit: Orbit
    parameters: np.ndarray
    multipliers: Eigenvalues
    angle: float
    residual: float
    unknowns: np.ndarray
    tangent: np.ndarray
    tests: dict[CodimensionTwo, float]
    kind: CodimensionTwo | None = None
    units: np.ndarray | None = None

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [
            ("parameters", _text.brief(self.parameters)),
            ("period", _text.brief(self.orbit.period)),
            ("start", _text.brief(np.asarray(self.orbit.y0))),
            ("multipliers", with_bars(*self.multipliers)),
            ("angle", "" if math.isnan(self.angle) else _text.brief(self.angle, "rad")),
        ]
        what = str(self.kind or self.curve)
        where = f" on a curve of {self.curve}s" if self.kind else ""
        return _text.table(f"{what[0].upper()}{what[1:]}{where}", rows)

    _repr_html_ = _text.html


@dataclasses.dataclass(frozen=True)
class Curve:
    """A curve of folds, branch points, period doublings or torus points in two parameters.

    Attributes:
      kind: of its orbits.
      members: the orbits, one per step.
      special: its points of codimension two, between them.
      before: the number of members before each special point.
      end: why it ends.
      equations: the equations they solve.
    """

    kind: Kind
    members: tuple[CurvePoint, ...]
    special: tuple[CurvePoint, ...]
    before: tuple[int, ...]
    end: str
    equations: Extended

    @_text.never_raising
    def __repr__(self) -> str:
        scene = self.members[0].orbit.scene
        special = [f"{x.kind} at {_text.brief(x.parameters)}" for x in self.special]
        ranges = zip(self.names, self.parameters.T, strict=True)
        rows = [
            *((name, _text.extent(values)) for name, values in ranges),
            ("period", _text.extent(self.periods)),
            ("special", ", ".join(special)),
            ("end", self.end),
        ]
        what = f"{_text.counted(len(self.members), self.kind)} of {_text.called(scene)}"
        return _text.table(f"Curve of {what}", rows)

    @_text.pictured
    def _repr_html_(self):
        from jaxdyn.drawing import bifurcations

        return bifurcations.bifurcation_curves([self], title="")

    @property
    def make(self) -> MakeOfTwo:
        """(p, q) -> scene."""
        return self.equations.make

    @property
    def names(self) -> tuple[str, str]:
        """The names of the parameters, those of the arguments of `make`."""
        try:
            first, second, *_ = inspect.signature(self.make).parameters
        except (TypeError, ValueError):
            return "first parameter", "second parameter"
        return first, second

    @property
    def points(self) -> tuple[CurvePoint, ...]:
        """Members and special points in order."""
        found = []
        for i, member in enumerate(self.members):
            here = zip(self.special, self.before, strict=True)
            found += [member, *(point for point, before in here if before == i + 1)]
        return tuple(found)

    @property
    def parameters(self) -> np.ndarray:
        """(n, 2) parameters of the members."""
        return np.array([member.parameters for member in self.members])

    @property
    def periods(self) -> np.ndarray:
        """(n,) periods of the members [time of the scene]."""
        return np.array([member.orbit.period for member in self.members])
