"""The points of a curve of folds or Hopf points in two parameters, and the curve itself."""

import abc
import dataclasses
import inspect
import math
from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

import equinox as eqx
import numpy as np
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn.analysis.eigenvalues import Eigenvalues
from jaxdyn.continuation.kinds import CodimensionTwo, Kind
from jaxdyn.scene import Scene

#: (p, q) -> scene.
MakeOfTwo = Callable[[Array, Array], Scene]


class Special(Protocol):
    """The common interface of the points of all curves."""

    @property
    def kind(self) -> CodimensionTwo | None: ...

    @property
    def parameters(self) -> np.ndarray: ...

    @property
    def unknowns(self) -> np.ndarray: ...

    @property
    def tangent(self) -> np.ndarray: ...


Point = TypeVar("Point", bound=Special)


class WithSecond(eqx.Module):
    """The scene as a function of the first parameter, with a value of the second."""

    make: MakeOfTwo
    second: Array

    def __call__(self, first: Array) -> Scene:
        """The scene for a value of the first parameter."""
        return self.make(first, self.second)


_PART_OF_STEP = 0.1  # largest distance of a point on the curve from a chord, in chord lengths
_PIECES = 12  # straight pieces between two points of a drawn line
_ROUNDING = 1e-12  # printed parameters below this part of the largest of the curve are 0


@dataclasses.dataclass(frozen=True)
class CurvePoint:
    """A fold or a Hopf point of a curve in two parameters.

    Attributes:
      curve: kind of the points of the curve, fold or Hopf point.
      state: (k,) the equilibrium.
      parameters: (2,) values of the parameters.
      eigenvalues: eigenvalues of the Jacobian, with bars.
      coefficient: the quadratic coefficient of a fold (NaN at a Bogdanov-Takens point), the first
        Lyapunov coefficient of a Hopf point.
      frequency: frequency of a Hopf point [rad per time], 0 at a Bogdanov-Takens point; NaN for
        folds.
      residual: largest entry of the residual of the point's equations, and of the condition of its
        kind at a special point.
      unknowns: (n,) state, parameters, critical vector, and for Hopf points the frequency squared.
      tangent: (n,) direction of the curve; a unit vector in state and parameters.
      left: (k,) unit null vector of the transposed Jacobian at a fold; NaN for Hopf points.
      tests: for each kind of special point, a number that vanishes there.
      kind: kind of special point, if it is one.
      normal_form: coefficients by name: "c" of a cusp, "a" and "b" of a Bogdanov-Takens point,
        the second Lyapunov coefficient "l2" of a Bautin point.
      units: (k + 3,) units of the state's entries, of the parameters and of time, in which the
        curve is followed; `tests` and `residual` are in these. None in a file of an earlier
        version.
    """

    curve: Kind
    state: np.ndarray
    parameters: np.ndarray
    eigenvalues: Eigenvalues
    coefficient: float
    frequency: float
    residual: float
    unknowns: np.ndarray
    tangent: np.ndarray
    left: np.ndarray
    tests: dict[CodimensionTwo, float]
    kind: CodimensionTwo | None = None
    normal_form: dict[str, float] = dataclasses.field(default_factory=dict)
    units: np.ndarray | None = None

    @property
    def x(self) -> np.ndarray:
        """(k + 2,) state and parameters."""
        return np.append(self.state, self.parameters)

    @property
    def criticality(self) -> str:
        """On a curve of Hopf points "supercritical" or "subcritical", "" elsewhere."""
        if self.curve != Kind.HOPF or self.kind or not abs(self.coefficient) > 0:
            return ""
        return "supercritical" if self.coefficient < 0 else "subcritical"

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [("parameters", _text.brief(self.parameters)), ("state", _text.brief(self.state))]
        numbers = ("coefficient", "frequency")
        known = [(name, getattr(self, name)) for name in numbers]
        known += list(self.normal_form.items())
        rows += [(name, _text.brief(x)) for name, x in known if not math.isnan(x)]
        what = " ".join(filter(None, (self.criticality, self.kind or self.curve)))
        where = f" on a curve of {self.curve}s" if self.kind else ""
        return _text.table(f"{what[0].upper()}{what[1:]}{where}", rows)

    _repr_html_ = _text.html


@dataclasses.dataclass(frozen=True)
class ParameterCurve(abc.ABC, Generic[Point]):
    """A curve in two parameters, of equilibria or of orbits.

    Attributes:
      kind: kind of its points.
      members: the points, one for each step.
      special: its points of codimension two, between them.
      before: the number of members before each special point.
      end: why it ends.
    """

    kind: Kind
    members: tuple[Point, ...]
    special: tuple[Point, ...]
    before: tuple[int, ...]
    end: str

    @_text.never_raising
    def __repr__(self) -> str:
        # A parameter that is negligible against the rest of the curve is 0 up to rounding.
        sizes = _ROUNDING * np.abs(self.parameters).max(axis=0)
        special = [f"{x.kind} at {_text.brief(_chop(x.parameters, sizes))}" for x in self.special]
        ranges = zip(self.names, _chop(self.parameters, sizes).T, strict=True)
        rows = [
            *((name, _text.extent(values)) for name, values in ranges),
            *self._more(),
            ("special", ", ".join(special)),
            ("end", self.end),
        ]
        return _text.table(f"Curve of {self._summary()}", rows)

    @_text.with_picture
    def _repr_html_(self):
        from jaxdyn.drawing import bifurcations

        return bifurcations.bifurcation_curves([self], title="")

    def _summary(self) -> str:
        """The number of points and their kind, in words."""
        return _text.number_of(len(self.members), self.kind)

    def _more(self) -> list[tuple[str, str]]:
        """Further rows of the printed table."""
        return []

    @property
    @abc.abstractmethod
    def names(self) -> tuple[str, str]:
        """The names of the parameters, which are those of the arguments of `make`."""

    @property
    def points(self) -> tuple[Point, ...]:
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
    @abc.abstractmethod
    def place(self) -> np.ndarray:
        """(n,) indices of the unknowns in which the curve is followed, the two parameters last."""

    def line(self, points: Sequence[Point]) -> np.ndarray:
        """(m, 2) parameters on a smooth line through some of its points that follow each other.

        Between two points it is a cubic with the tangents there, over the length of their chord in
        all unknowns. Over that length the parameters are smooth at a cusp too, where a line through
        the parameters alone would have a corner.
        """
        x = np.array([point.unknowns[self.place] for point in points])
        slopes = np.array([point.tangent[self.place] for point in points])
        extent = np.ptp(x, axis=0)
        sizes = np.where(extent > 0, extent, np.inf)
        slopes = slopes / np.linalg.norm(slopes / sizes, axis=1)[:, None]
        chords = np.diff(x / sizes, axis=0)[:, None]
        ends = np.stack([slopes[:-1], slopes[1:]], axis=1)
        forwards = np.sign(np.sum(chords * ends / sizes, axis=2, keepdims=True))
        ends = np.linalg.norm(chords, axis=2, keepdims=True) * forwards * ends
        first, last = ends[:, :1, -2:], ends[:, 1:, -2:]
        start, change = x[:-1, None, -2:], np.diff(x[:, -2:], axis=0)[:, None]
        s = np.linspace(0.0, 1.0, _PIECES, endpoint=False)[:, None]
        bend = 3 * change - 2 * first - last + s * (first + last - 2 * change)
        return np.concatenate([*(start + s * (first + s * bend)), x[-1:, -2:]])


def _chop(x: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Numbers with 0 for those that are smaller than `sizes`."""
    return np.where(np.abs(x) < sizes, 0.0, x)


@dataclasses.dataclass(frozen=True, repr=False)
class Curve(ParameterCurve[CurvePoint]):
    """A curve of folds or of Hopf points in two parameters.

    Attributes:
      kind: kind of its points, fold or Hopf point.
      members: the points, one for each step.
      special: its points of codimension two, between them.
      before: the number of members before each special point.
      end: why it ends.
      make: (p, q) -> scene.
    """

    make: MakeOfTwo

    @property
    def names(self) -> tuple[str, str]:
        """The names of the parameters, which are those of the arguments of `make`."""
        return parameter_names(self.make)

    @property
    def place(self) -> np.ndarray:
        """(k + 2,) indices of state and parameters among the unknowns."""
        return np.arange(len(self.members[0].x))

    @property
    def states(self) -> np.ndarray:
        """(n, k) states of the members."""
        return np.array([member.state for member in self.members])

    def passes(self, x) -> bool:
        """Whether it passes a point (k + 2,), state and parameters, judged by its chords."""
        members = np.array([member.x for member in self.members])
        extent = np.ptp(members, axis=0)
        sizes = np.where(extent > 0, extent, 1.0)
        _, apart = beside_chords(members / sizes, np.asarray(x) / sizes)
        return bool((apart <= _PART_OF_STEP).any())


def beside_chords(points: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The place on each chord of points (n, k) that is nearest to a point (k,), and its distance.

    Both are (n - 1,): the place as a fraction of the chord, 0 or 1 where an end is nearest, and the
    distance in lengths of the chord.
    """
    off, along = x - points[:-1], np.diff(points, axis=0)
    squares = np.maximum(np.sum(along**2, 1), np.finfo(float).tiny)
    share = np.clip(np.sum(off * along, 1) / squares, 0.0, 1.0)
    return share, np.linalg.norm(off - share[:, None] * along, axis=1) / np.sqrt(squares)


def parameter_names(make: MakeOfTwo) -> tuple[str, str]:
    """The names of the arguments of a function of two parameters."""
    try:
        first, second, *_ = inspect.signature(make).parameters
    except (TypeError, ValueError):
        return "first parameter", "second parameter"
    return first, second
