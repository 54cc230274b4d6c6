"""Curves of folds, branch points, period doublings and torus points of orbits in two parameters.

A curve is followed by pseudo-arclength in start, period and both parameters, with the equations of
`extended`; `special_points` finds the points of codimension two on it.
"""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import array, check_on_host, fail, positive, whole
from jaxdyn._records import with_captures
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.continuation.branch import ANYWHERE, Bounded, BranchProblem, check_bounds, follow
from jaxdyn.continuation.checkpoint import Codec, Log
from jaxdyn.continuation.kinds import CodimensionTwo, Kind
from jaxdyn.continuation.units import Units
from jaxdyn.integrate.spans import tolerances
from orbits.analysis.stability import stability
from orbits.closing.closings import PLAIN, Return
from orbits.closing.given import is_driven
from orbits.closing.sizes import sizes
from orbits.curves.checkpoint import ORBIT_CURVE, about, codec
from orbits.curves.curve import OrbitCurve, OrbitCurvePoint
from orbits.curves.extended import VECTORS, Extended, MakeOfTwo, extended_make
from orbits.curves.steps import CurveChart, partial_return, point_at, solve
from orbits.curves.units import as_member, place_units, units_at
from orbits.families.family import Member, smooth_orbit
from orbits.orbit import Orbit
from orbits.shooting.segment import Piece, linearize_end

# ---- Points of codimension two between two neighbours of a curve of special orbits
#
# Each kind has a test function of a point, which changes sign there; its zero is located along
# the curve (`Chart.locate`). At a cusp both parameters turn: the test is their change along the
# curve, projected on its direction before the cusp. The tests of the other kinds, in `steps`, are
# functions of the multipliers other than the critical ones or, at the strong resonances of a torus
# point, of its angle.
#
# Reference: Kuznetsov (2004), Elements of Applied Bifurcation Theory, 3rd edition, chapters 9 and
# 10.

#: Largest value of a test at a special point.
GOAL = 1e-9
#: Largest change of both parameters along the curve at a cusp, relative to the point before.
_TURNED = 1e-6


def special_points(
    chart: CurveChart, a: OrbitCurvePoint, b: OrbitCurvePoint
) -> list[OrbitCurvePoint]:
    """The points of codimension two between two neighbours, in order."""
    found = [_zero(chart, a, b, kind) for kind in a.tests]
    if chart.extended.kind == Kind.FOLD:
        found.append(_cusp(chart, a, b))
    kept = [point for point in found if point is not None]
    return sorted(kept, key=lambda point: chart.along(a, point))


def _zero(
    chart: CurveChart, a: OrbitCurvePoint, b: OrbitCurvePoint, kind
) -> OrbitCurvePoint | None:
    best = chart.locate(lambda point: point.tests[kind], a, b)
    if best is None or abs(best.tests[kind]) > GOAL:
        return None
    return dataclasses.replace(best, kind=kind, residual=max(best.residual, abs(best.tests[kind])))


def _cusp(chart: CurveChart, a: OrbitCurvePoint, b: OrbitCurvePoint) -> OrbitCurvePoint | None:
    before = _turning(chart, a)
    best = chart.locate(lambda point: float(_turning(chart, point) @ before), a, b)
    if best is None:
        return None
    # Otherwise the curve only turns by a right angle in the plane of the parameters.
    if np.linalg.norm(_turning(chart, best)) > _TURNED * np.linalg.norm(before):
        return None
    return dataclasses.replace(best, kind=CodimensionTwo.CUSP)


def _turning(chart: CurveChart, point: OrbitCurvePoint) -> np.ndarray:
    """(2,) the change of the parameters along the curve, in units."""
    return point.tangent[chart.measured[-2:]] / chart.units.parameters


# ---- Curves of folds, branch points, period doublings and torus points of orbits in two parameters

RTOL = 1e-13
_GROWTH = 1e3  # largest growth of errors over a segment
_MOST_SEGMENTS = 32
_LOST = "no orbit of the curve was found beyond: a collision, or an equilibrium"


def continue_curve(
    make: MakeOfTwo,
    point: Member | OrbitCurvePoint | Orbit,
    parameters: tuple[float, float] | None = None,
    *,
    kind: Kind | None = None,
    step: float = 0.05,
    members: int = 50,
    down: bool = False,
    within: tuple[tuple[float, float], tuple[float, float]] = (ANYWHERE, ANYWHERE),
    segments: int | None = None,
    rtol: float = RTOL,
    report: Callable[[OrbitCurvePoint], None] = lambda point: None,
    path: str | Path | Log | None = None,
) -> OrbitCurve:
    """The curve of special orbits in two parameters, with its points of codimension two.

    Cusps, resonances 1:1 to 1:4, and points where two of fold, period doubling and torus point
    coincide are located to rounding.

    Args:
      make: the scene for each pair of parameters, e.g. a function ``(drive, damping) -> scene``;
        its start and span do not matter. A program is compiled for each function, so define it
        once.
      point: a fold, branch point, period doubling or torus point, from ``family.special`` of
        `continue_family`; or a special point of another curve, or an orbit near the curve.
      parameters: the values of both parameters at `point`; by default those of a point of a curve.
      kind: kind of the curve; by default that of the point, required for an orbit.
      step: length of the first step in start, period and parameters, in units of the sizes of the
        entries, of a radian of the period, and of the parameters' units (`orbits.curves.units`);
        later steps are up to ten times as long.
      members: largest number of members.
      down: start towards a smaller second parameter.
      within: bounds on each parameter; a curve that leaves them ends with the member on the bound.
      segments: number of segments of multiple shooting; by default as many as the growth of errors
        requires.
      rtol: tolerance of the integrations.
      report: called with each member as it is found.
      path: file (.jsonl) to which each member is written as it is found, and which may hold several
        curves; the same call resumes from it where it was interrupted. See `orbits.curves.load`.
    Returns:
      The members, and the special points between them.
    Raises:
      ValueError: `point` is of another kind, there is no such orbit near it, the scene has a first
        integral, or a number is out of range or traced.
    Limits: host only. A branch point is followed only where a symmetry preserves it: the orbit must
      close after one of two parts (``closing=orbits.Return(symmetry, parts=2)``), over twice the
      period of a drive, and then special points other than cusps are not named. A curve of torus
      points ends at a 1:1 or 1:2 resonance. A curve of a driven scene ends before the drive
      vanishes, as at the tip of an Arnold tongue: bound its amplitude away from 0.
    Reference: Govaerts, Kuznetsov, Dhooge (2005), SIAM J. Sci. Comput. 27, 231; Kuznetsov (2004),
      Elements of Applied Bifurcation Theory, chapters 9 and 10.
    """
    check_on_host("continue_curve", parameters, "See orbits.differentiable, for each member.")
    positive("step", step, "It is a length in the space of the unknowns.")
    members = whole("members", members)
    tolerances(rtol, None)
    for bounds in within:
        check_bounds("within", bounds)
    orbit, kind, both = _start(point, parameters, kind)
    make = with_captures(make, "first", "second")
    extended, start, units = _unknowns(make, orbit, kind, both, segments, rtol)
    first = _first(extended, start, units, step, -1.0 if down else 1.0)
    found = follow(_Problem(extended, within), first, step, members, report, path)
    return OrbitCurve(kind=first.curve, equations=extended, **found._asdict())


def _start(point, parameters, kind: Kind | None) -> tuple[Orbit, Kind, np.ndarray]:
    """The orbit, the kind of the curve, and (2,) the parameters."""
    if isinstance(point, OrbitCurvePoint):
        orbit, curve = point.orbit, point.curve if kind is None else Kind(kind)
        parameters = point.parameters if parameters is None else parameters
    elif isinstance(point, Member):
        orbit = smooth_orbit("point", point.orbit)
        curve = point.kind if kind is None else Kind(kind)
    elif isinstance(point, Orbit):
        orbit, curve = point, None if kind is None else Kind(kind)
    else:
        expected = "a Member, an OrbitCurvePoint or an Orbit"
        raise fail("point", expected, type(point).__name__)
    if curve is None or curve not in VECTORS:
        expected = "a fold, branch point, period doubling or torus point"
        remedy = "Choose one of family.special, or give kind=."
        raise fail("point", expected, curve or "an ordinary orbit", remedy)
    if parameters is None:
        raise fail("parameters", "the values of both parameters at the point", None)
    return orbit, curve, np.asarray(array("parameters", parameters, (2,)))


def _closing(orbit: Orbit, kind: Kind) -> Return:
    closing = orbit.closing
    if isinstance(closing, Return) and closing.parts == 2 and not closing.turns:
        # The map over one part has the multiplier 1 at a fold, and -1 where the symmetry is lost.
        return closing if kind in (Kind.BRANCH, Kind.FOLD) else PLAIN
    if kind == Kind.BRANCH:
        signs = ", ".join(["-1"] * len(orbit.y0))
        remedy = (
            "Find the orbit with closing=orbits.Return(symmetry, parts=2), over twice the period "
            f"of a drive; the symmetry y -> -y is orbits.Symmetry(signs=({signs})), if it is one."
        )
        raise fail("point", "a branch point of orbits that close by a symmetry", "another", remedy)
    return PLAIN


def _unknowns(make, orbit: Orbit, kind: Kind, both, segments, rtol):
    """The equations, the unknowns near an orbit, and their units."""
    scene = make(*jnp.asarray(both))
    if not isinstance(scene, Scene) or len(scene.labels()) != len(orbit.y0):
        raise fail("make", f"a scene with a state of {len(orbit.y0)} entries", scene)
    extended = Extended(
        make=make,
        kind=kind,
        closing=_closing(orbit, kind),
        driven=is_driven(scene.starting(orbit.y0, orbit.period)),
        segments=1,
        k=len(orbit.y0),
        rtol=rtol,
    )
    here = scene.starting(orbit.y0, orbit.period)
    known = stability(dataclasses.replace(orbit, scene=here, closing=PLAIN), throw=False)
    if known.integrals:
        remedy = "Its orbits form families at fixed parameters; add a little damping."
        reasons = ", ".join(known.reasons)
        raise fail("make", "scenes without a first integral", reasons, remedy)
    if segments is None:
        growth = np.linalg.norm(map_in_units(known.monodromy, sizes(here)), 2)
        pieces = math.log(max(growth, 1.0)) / math.log(_GROWTH) if np.isfinite(growth) else 1.0
        segments = 2 ** math.ceil(math.log2(max(pieces, 1.0)))
    segments = whole("segments", segments, most=_MOST_SEGMENTS)
    extended = dataclasses.replace(extended, segments=segments)
    return extended, *_unknowns_of(extended, orbit, both)


def _unknowns_of(extended: Extended, orbit: Orbit, both: np.ndarray) -> tuple[np.ndarray, Units]:
    """The unknowns of an orbit, with critical vectors from its monodromy matrix, and its units."""
    n, m, k = extended.segments, extended.vectors, extended.k
    scenes = extended_make(extended.make, m)
    span = orbit.period / (extended.closing.parts * n)
    states, maps = [np.asarray(orbit.y0)], []
    for i in range(n):
        piece = Piece(
            start=np.concatenate([states[-1], np.zeros(m * k)]),
            t0=i * span * extended.driven,
            span=span,
            parameter=both,
        )
        found = linearize_end(scenes(jnp.asarray(both)), piece, extended.rtol, make=scenes)
        states.append(np.asarray(found.y1)[:k])
        maps.append(np.asarray(found.slopes.start)[:k, :k])
    monodromy = np.eye(k)
    for one in maps:
        monodromy = one @ monodromy
    units = units_at(extended, np.array(states[:-1]), orbit.period, both)
    scene = extended.make(*jnp.asarray(both)).starting(orbit.y0, orbit.period)
    g = partial_return(extended, dataclasses.replace(orbit, scene=scene), monodromy)
    flow = units.time * np.asarray(scene.rate(0.0, scene.y0)) / units.each
    vectors, extra = _critical(extended, map_in_units(g, units.each), flow)
    carried = [vectors * units.each]
    for one in maps[:-1]:
        carried.append(carried[-1] @ one.T)
    extra = extra * (units.time if extended.kind == Kind.FOLD else 1.0)
    return extended.pack(states[:-1], carried, orbit.period, both, extra), units


def _critical(extended: Extended, g: np.ndarray, flow: np.ndarray) -> tuple[np.ndarray, float]:
    """(m, k) the critical vectors of the map g over a part, and b or c; all in units."""
    k = len(g)
    if extended.kind == Kind.FOLD:
        if extended.driven:
            return np.linalg.svd(g - np.eye(k))[2][-1:], 0.0
        bordered = np.block([[g - np.eye(k), flow[:, None]], [flow[None], np.zeros((1, 1))]])
        null = np.linalg.svd(bordered)[2][-1]
        return null[None, :k] / np.linalg.norm(null[:k]), null[k] / np.linalg.norm(null[:k])
    if extended.kind != Kind.TORUS:
        return np.linalg.svd(g + np.eye(k))[2][-1:], 0.0
    values, vectors = np.linalg.eig(g)
    upper = np.flatnonzero(values.imag > 0)
    if not len(upper):
        raise fail("point", "an orbit with complex multipliers", "real ones alone")
    pair = upper[np.argmin(np.abs(np.abs(values[upper]) - 1))]
    cosine = values[pair].real / abs(values[pair])
    # Take a vector in the plane of the pair that the map changes strongly, so not one near the
    # eigenvector, the only one of the plane at a 1:1 resonance. Where all vectors change equally,
    # as in a rotation, the choice is still reproducible.
    plane = np.linalg.qr(np.stack([vectors[:, pair].real, vectors[:, pair].imag], axis=1))[0]
    change = g @ plane - cosine * plane
    w = plane @ (change.T @ change @ (plane.T @ np.random.default_rng(0).standard_normal(k)))
    w = w / np.linalg.norm(w)
    return np.stack([w, g @ w]), float(cosine)


def _first(
    extended: Extended, start: np.ndarray, units: Units, step: float, sign: float
) -> OrbitCurvePoint:
    """The point of the curve nearest to a start; along it the second parameter grows for sign 1."""
    size = len(extended.place)
    place = start[extended.place]
    up = np.append(np.zeros(size - 1), sign)
    for fixed in (up, np.roll(up, -1), *np.eye(size)[: size - 3]):
        found = solve(extended, start, place, fixed, units)
        if found is None:
            continue
        moved = (found.x[extended.place] - place) / place_units(units)
        if np.linalg.norm(moved) <= step:
            point = point_at(extended, found, fixed, units)
            backwards = point.tangent[extended.place[-1]] * sign < 0
            return as_member(extended, point, -1.0 if backwards else 1.0)
    raise fail(
        "point",
        f"a {extended.kind} of make(p, q) less than a step away",
        f"none near the parameters {place[-2:].tolist()}",
        "`parameters` must be those of the point.",
    )


class _Problem(BranchProblem[OrbitCurvePoint]):
    """A curve within bounds on the parameters."""

    what = ORBIT_CURVE

    def __init__(self, extended: Extended, within):
        self.extended, self.within = extended, within

    def chart(self, member: OrbitCurvePoint) -> CurveChart:
        return CurveChart(self.extended, member)

    def codec(self) -> Codec:
        return codec(self.extended)

    def about(self) -> dict[str, Any]:
        return about(self.extended)

    def special(self, chart: CurveChart, a, b, first: bool) -> list[OrbitCurvePoint]:
        return special_points(chart, a, b)

    def end_before(self, new: OrbitCurvePoint, special: list[OrbitCurvePoint]) -> str:
        real = new.curve == Kind.TORUS and abs(self.extended.unpack(new.unknowns).extra) >= 1
        return "a strong resonance, beyond which the multipliers are real" if real else ""

    def bounded(self, chart: CurveChart, member: OrbitCurvePoint) -> list[Bounded]:
        return [Bounded(member.parameters, self.within, units=chart.units.parameters)]

    def lost(self, reason: str) -> str:
        return _LOST
