"""Curves of folds and Hopf points of equilibria in two parameters.

A curve is followed by pseudo-arclength in state and both parameters, with the equations of
`augmented`; `codimension_two` finds the special points on it.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxdyn import _checks
from jaxdyn._records import with_captures
from jaxdyn.continuation import augmented
from jaxdyn.continuation.branch import ANYWHERE, Bounded, BranchProblem, check_bounds, follow
from jaxdyn.continuation.checkpoint import CURVE, Codec, Log, of_fields
from jaxdyn.continuation.codimension_two import CurveChart, point_at, special_points
from jaxdyn.continuation.curve import Curve, CurvePoint, MakeOfTwo
from jaxdyn.continuation.family import Equilibrium
from jaxdyn.continuation.kinds import CodimensionTwo, Kind
from jaxdyn.continuation.units import Units, units_at, units_of
from jaxdyn.scales import groups
from jaxdyn.scene import check_scene

_AT_END = 1e-8  # a Hopf point with a smaller frequency squared is a Bogdanov-Takens point
_BEYOND = "a Bogdanov-Takens point, beyond which the eigenvalues are real"
_SAME_PLACE = 1e-6  # relative distance below which two points are the same


def continue_curve(
    make: MakeOfTwo,
    point: Equilibrium | CurvePoint,
    parameters: tuple[float, float] | None = None,
    *,
    kind: Kind | None = None,
    step: float = 0.05,
    members: int = 100,
    down: bool = False,
    within: tuple[tuple[float, float], tuple[float, float]] = (ANYWHERE, ANYWHERE),
    report: Callable[[CurvePoint], None] = lambda point: None,
    path: str | Path | Log | None = None,
) -> Curve:
    """The curve of folds or Hopf points in two parameters, with its points of codimension two.

    Cusps, Bogdanov-Takens, Bautin, zero-Hopf and double Hopf points are located to rounding, and
    have those coefficients of their normal forms that `CurvePoint` names.

    Args:
      make: the scene for each pair of parameters, e.g. ``lambda rho, beta: lorenz(rho=rho,
        beta=beta)``; its start and span do not matter. A program is compiled for each function, so
        define it once.
      point: a fold or a Hopf point, from ``family.special`` of `continue_equilibria`; or a special
        point of another curve.
      parameters: the values of both parameters at `point`; by default its own, if it is on a curve.
      kind: kind of the curve, `Kind.FOLD` or `Kind.HOPF`; that of the point by default. A curve of
        each kind passes a Bogdanov-Takens and a zero-Hopf point; from a double Hopf point
        `Kind.HOPF` leads along the other pair of eigenvalues.
      step: length of the first step in state and parameters, each in units of its size (`units`);
        the other steps are up to ten times as long.
      members: largest number of members.
      down: start towards a smaller second parameter; at a Bogdanov-Takens point a curve of Hopf
        points has one direction only.
      within: bounds on each parameter; a curve that leaves them ends with the member on the bound.
      report: called with each member as it is found.
      path: file (.jsonl) that saves each member as it is found, and may contain several families
        and curves; the same call resumes from it after an interruption. See
        `jaxdyn.continuation.load`.
    Returns:
      The members, and the special points between them.
    Raises:
      ValueError: `point` is of another kind, there is no such point near it, or a number is out of
        range or traced.
    Limits: host only. A special point is detected where its test changes sign between two members;
      two of one kind within one step are not. A curve of Hopf points ends at a Bogdanov-Takens
      point, beyond which the eigenvalues are real.
    Reference: Govaerts (2000), Numerical Methods for Bifurcations of Dynamical Equilibria, chapters
      4 and 8; Kuznetsov (2004), Elements of Applied Bifurcation Theory, chapters 8 and 10.
    Example:
      >>> import jaxdyn
      >>> def rate(t, y, c):
      ...     return [c[0] + c[1] * y[0] - y[0] ** 3]
      >>> def make(p, q):
      ...     return jaxdyn.ode(rate, [0.0], params=[p, q])
      >>> family = jaxdyn.continue_equilibria(
      ...     lambda p: make(p, 1.0), -1.0, [-1.3], within=(-1, 1)
      ... )
      >>> fold = family.special[0]
      >>> curve = jaxdyn.continue_curve(make, fold, (0.385, 1.0), down=True, members=30)
      >>> [str(x.kind) for x in curve.special]  # at p = q = 0
      ['cusp']
    """
    _checks.check_on_host("continue_curve", parameters, "See orbits.differentiable.")
    _checks.float64()
    _checks.positive(
        "step", step, "It is a length in state and parameters, in units of their sizes."
    )
    members = _checks.whole("members", members)
    for bounds in within:
        check_bounds("within", bounds)
    curve, x = _start(point, parameters, kind)
    make = with_captures(make, "first", "second")
    check_scene(make(jnp.asarray(x[-2]), jnp.asarray(x[-1])))
    units = _units(make, point, x)
    first = units.outward(_first(units, make, point, curve, x, step, -1.0 if down else 1.0))
    known = point if isinstance(point, CurvePoint) else None
    found = follow(_Problem(make, known, within, first), first, step, members, report, path)
    return Curve(kind=first.curve, make=make, **found._asdict())


def _units(make: MakeOfTwo, point: Equilibrium | CurvePoint, x: np.ndarray) -> Units:
    """The units at (k + 2,) state and parameters: those of the point, as far as it has any."""
    if isinstance(point, CurvePoint):
        return units_of(make, point)
    own = units_at(make, x, len(point.state))
    if point.units is None:
        return own
    known = Units.of(point.units, len(point.state))
    return known._replace(parameters=np.append(known.parameters, own.parameters[1]))


def _first(units: Units, make: MakeOfTwo, point, curve: Kind, x, step, sign: float) -> CurvePoint:
    scene, here = units.scene(make), x / units.x
    again = isinstance(point, CurvePoint) and curve == Kind.HOPF == point.curve
    double = again and point.kind == CodimensionTwo.DOUBLE_HOPF
    other = point.frequency * units.time if double else None
    start = augmented.first_unknowns(curve, scene, here, other)
    found = None if start is None else _nearest(curve, scene, start, len(x), sign)
    if found is None or np.linalg.norm(found.x - here) > step:
        raise _checks.fail(
            "point",
            f"a {curve} of make(p, q) less than a step away",
            f"none near the parameters {x[-2:].tolist()}",
            "`parameters` must be those of the point.",
        )
    return found


def _start(point, parameters, kind: Kind | None) -> tuple[Kind, np.ndarray]:
    """The kind of the curve, and (k + 2,) state and parameters."""
    if isinstance(point, CurvePoint):
        curve = point.curve if kind is None else Kind(kind)
        parameters = point.parameters if parameters is None else parameters
    elif isinstance(point, Equilibrium):
        curve = point.kind if kind is None else Kind(kind)
    else:
        raise _checks.fail("point", "an Equilibrium or a CurvePoint", type(point).__name__)
    if curve is None or curve not in augmented.SYSTEMS:
        remedy = "Choose one of family.special."
        raise _checks.fail("point", "a fold or a Hopf point", curve or "an ordinary member", remedy)
    if parameters is None:
        raise _checks.fail("parameters", "the values of both parameters at the point", None)
    both = np.asarray(_checks.array("parameters", parameters, (2,)))
    return curve, np.append(point.state, both)


def _nearest(curve: Kind, make, start: np.ndarray, size: int, sign: float) -> CurvePoint | None:
    """The point of the curve near a start; the second parameter grows along it for sign 1."""
    up = np.append(np.zeros(size - 1), sign)
    for fixed in (up, np.roll(up, -1), *np.eye(size)[: size - 2]):
        found = augmented.solve(curve, make, start, start[:size], fixed)
        if found is None:
            continue
        point = point_at(curve, make, found, fixed, None)
        if point is not None:
            # From a Bogdanov-Takens point, Hopf points lead in one direction only.
            ends = curve == Kind.HOPF and abs(point.unknowns[-1]) < _AT_END
            backwards = (point.tangent[-1] if ends else point.tangent[size - 1] * sign) < 0
            return dataclasses.replace(point, tangent=-point.tangent) if backwards else point
    return None


class _Problem(BranchProblem[CurvePoint]):
    """A curve within bounds on the parameters, which may begin at a special point `start`."""

    what = CURVE

    def __init__(self, make: MakeOfTwo, start: CurvePoint | None, within, first: CurvePoint):
        self.make, self.start, self.within = make, start, within
        self.kind, self.known = first.curve, groups(make(*first.parameters).system)

    def chart(self, member: CurvePoint) -> CurveChart:
        return CurveChart(self.make, units_of(self.make, member), self.known)

    def codec(self) -> Codec:
        return of_fields(CurvePoint)

    def about(self) -> dict[str, str]:
        return {"kind": str(self.kind)}

    def special(self, chart: CurveChart, a, b, first: bool) -> list[CurvePoint]:
        found = special_points(chart, a, b, first)
        if self.start is None or self.start.kind is None:
            return found
        # Without the special point at which the curve starts.
        start = chart.inward(self.start).x
        reach = _SAME_PLACE * (1.0 + np.linalg.norm(start))
        return [point for point in found if np.linalg.norm(point.x - start) > reach]

    def end_before(self, new: CurvePoint, special: list[CurvePoint]) -> str:
        real = new.curve == Kind.HOPF and new.unknowns[-1] <= 0
        return _BEYOND if real else ""

    def bounded(self, chart: CurveChart, member: CurvePoint) -> list[Bounded]:
        units = chart.units.parameters
        return [Bounded(member.parameters * units, self.within, units=units)]

    def lost(self, reason: str) -> str:
        return "no point of the curve was found beyond"
