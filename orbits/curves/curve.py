"""The orbits of a curve in two parameters, and the curve itself."""

import dataclasses
import math

import numpy as np

from jaxdyn import _text
from jaxdyn.analysis.eigenvalues import Eigenvalues, with_bars
from jaxdyn.continuation.curve import ParameterCurve, parameter_names
from jaxdyn.continuation.kinds import CodimensionTwo, Kind
from orbits.curves.extended import Extended, MakeOfTwo
from orbits.orbit import Orbit


@dataclasses.dataclass(frozen=True)
class OrbitCurvePoint:
    """A special orbit of a curve in two parameters.

    Attributes:
      curve: kind of the orbits of the curve.
      orbit: the orbit.
      parameters: (2,) its values of the parameters.
      multipliers: multipliers, with bars, of the map over one part of the period followed by the
        inverse of the closing's symmetry, without the one along the flow.
      angle: angle of the critical multipliers of a torus point [rad]; NaN for other kinds.
      residual: largest entry of the residual of the point's equations, in its units, and of the
        condition of its kind at a special point.
      unknowns: (n,) unknowns of the equations.
      tangent: (n,) direction of the curve, of unit length in start, period and parameters, in the
        point's units.
      tests: for each kind of special point, the value of a test function that vanishes there.
      kind: kind of special point, if it is one.
      units: (k + 3,) units of the state's entries, of the parameters and of time (`units`), in
        which the curve is followed. None in a file of an earlier version.
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


@dataclasses.dataclass(frozen=True, repr=False)
class OrbitCurve(ParameterCurve[OrbitCurvePoint]):
    """A curve of folds, branch points, period doublings or torus points in two parameters.

    Attributes:
      kind: kind of its orbits.
      members: the orbits, one per step.
      special: its points of codimension two, between members.
      before: the number of members before each special point.
      end: why the curve ends.
      equations: the equations that the members solve.
    """

    equations: Extended

    def _summary(self) -> str:
        return f"{super()._summary()} of {_text.title_of(self.members[0].orbit.scene)}"

    def _more(self) -> list[tuple[str, str]]:
        return [("period", _text.extent(self.periods))]

    @property
    def make(self) -> MakeOfTwo:
        """The function (p, q) -> scene."""
        return self.equations.make

    @property
    def names(self) -> tuple[str, str]:
        """The names of the parameters, those of the arguments of `make`."""
        return parameter_names(self.make)

    @property
    def place(self) -> np.ndarray:
        """(k + 3,) indices of start, period and parameters among the unknowns."""
        return self.equations.place

    @property
    def periods(self) -> np.ndarray:
        """(n,) periods of the members [time of the scene]."""
        return np.array([member.orbit.period for member in self.members])
