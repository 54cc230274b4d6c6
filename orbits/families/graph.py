"""The graph of families: at which special points they meet.

A place is a special point that belongs to several families: a branch point, a period doubling
(where the orbits of one family are those of the other traced twice), or an equilibrium to which
orbits shrink. A family reaches a place if one of its own special points is the same orbit, or if it
ends beside the place, as do the families that `switch_branch` and `from_hopf` begin: then orbits of
the family are found ever nearer to the place, each at half the distance of the one before.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from jaxdyn import _progress, _text
from jaxdyn._checks import check_first, fail
from jaxdyn._doors import renamed
from jaxdyn._text import number_of
from jaxdyn.analysis.energy import energy
from jaxdyn.continuation.family import EquilibriumFamily
from jaxdyn.continuation.kinds import Kind
from jaxdyn.continuation.units import units_of
from jaxdyn.system import differences
from orbits.closing.closings import PLAIN
from orbits.families.diagram import Diagram
from orbits.families.family import Family, Member, smooth_orbit, where
from orbits.families.sizes import unknown_sizes
from orbits.families.surface import OrbitSurface, Point
from orbits.motion import quick_solve
from orbits.orbit import Orbit
from orbits.shooting.deflation import distance, known_orbits
from orbits.shooting.equations import Equations, units_of_unknowns
from orbits.shooting.strategy import GOAL

#: Distance, in units, up to which two special points are one: each is known only to the square root
#: of rounding, and lies between samples.
_SAME = 1e-3
#: Largest relative distance of a place from the end of a family that begins there, and largest
#: relative difference of their periods.
_NEAR = 0.1
_AHEAD = 0.7  # least cosine of the angle between a family and the direction to such a place
_HALVINGS = 4
#: Largest distance between the orbit expected halfway and the one found, as a share of half of the
#: distance to the place: if it is larger, the family has bent.
_BENT = 0.5
_RESTS = (str(Kind.REST), str(Kind.HOPF))
_SAMPLES = 256  # samples of an orbit, to find the phase at which it is nearest to another


@renamed(rests="equilibria")
@dataclasses.dataclass(frozen=True)
class Place:
    """A special point at which families meet.

    Attributes:
      kind: kind of special point.
      orbit: its orbit, or an equilibrium with the period of small oscillations about it.
      parameter: its value of the families' parameter; NaN without one.
      energy: energy of the scene there; NaN without one.
      families: numbers of the families that meet, from 0.
      times: for each family, how often its orbits trace that of the place: 1, or 2 at a doubling.
      equilibria: numbers of the families of equilibria to which it belongs.
      units: (k + 1,) sizes of the entries of the state, and the unit of the parameter, along its
        family.
    """

    kind: str
    orbit: Orbit
    parameter: float
    energy: float
    families: tuple[int, ...]
    times: tuple[int, ...]
    equilibria: tuple[int, ...] = ()
    units: np.ndarray | None = None

    @property
    def period(self) -> float:
        """The period of its orbit [time of the scene]."""
        return self.orbit.period


@renamed(rests="equilibria")
@dataclasses.dataclass(frozen=True)
class Graph:
    """Families, and the places at which they meet.

    Attributes:
      families: families of orbits.
      equilibria: families of equilibria.
      places: places where at least two of them meet.
    """

    families: tuple[Family, ...]
    equilibria: tuple[EquilibriumFamily, ...]
    places: tuple[Place, ...]

    @property
    def components(self) -> list[tuple[int, ...]]:
        """The numbers of the families in each connected component, the largest first."""
        groups = [{i} for i in range(len(self.families))]
        for place in self.places:
            met = [group for group in groups if group & set(place.families)]
            groups = [group for group in groups if group not in met]
            groups += [set().union(*met)] if met else []
        return sorted((tuple(sorted(group)) for group in groups), key=lambda g: (-len(g), g))

    @_text.never_raising
    def __repr__(self) -> str:
        rows = []
        for place in self.places:
            met = [
                f"{i + 1}{' (twice)' if times == 2 else ''}"
                for i, times in zip(place.families, place.times, strict=True)
            ]
            met += [f"equilibria {i + 1}" for i in place.equilibria]
            rows.append((place.kind, f"families {', '.join(met)} at {where(place)}"))
        joined = "; ".join(", ".join(str(i + 1) for i in group) for group in self.components)
        families = number_of(len(self.families), "family", "families")
        return _text.table(f"Graph of {families} of orbits", [("joined", joined), *rows])

    @_text.with_picture
    def _repr_html_(self):
        from orbits.drawing import graphs

        return graphs.graph(self, title="")


@check_first
def graph(families: Sequence[Family] | Diagram) -> Graph:
    """The graph of families that meet at special points.

    Args:
      families: families of one scene, or in one parameter of it; or a result of `diagram`.
    Returns:
      The families with the places at which two or more meet.
    Raises:
      ValueError: there is no family, or they differ in whether they have a parameter.
    Limits: host only. A family joins a place where it has a special point itself or near which it
      ends; a family that passes a place without a special point is not detected.
    Example:
      >>> import jaxdyn, orbits
      >>> def make(mu):
      ...     return jaxdyn.ode(
      ...         lambda t, y, mu: [y[1], mu * y[1] - y[0] ** 2 * y[1] - y[0]],
      ...         [0.0, 0.0], 10.0, params=mu)
      >>> found = orbits.diagram(make, -0.5, [0.0, 0.0], within=(-1, 1), orbit_members=4)
      >>> place, = orbits.graph(found).places
      >>> str(place.kind), place.families, place.equilibria
      ('Hopf point', (0,), (0,))
    """
    several = families.orbits if isinstance(families, Diagram) else tuple(families)
    equilibria = families.equilibria if isinstance(families, Diagram) else ()
    if not several:
        raise fail("families", "at least one family of orbits", "none")
    if len({family.equations.make is None for family in several}) > 1:
        raise fail("families", "all with a parameter, or all without", "some of both")
    for family in several:
        smooth_orbit("families", family.members[0].orbit)
    places: list[Place] = []
    for place in _places(several, equilibria):
        _progress.report_progress(
            f"which families meet at the {place.kind} at {where(place)}", len(places)
        )
        if not any(_same(place, other) for other in places):
            arrivals = [(i, _arrivals(place, family)) for i, family in enumerate(several)]
            met = [(i, times) for i, times in arrivals if times]
            numbers, times = zip(*met, strict=True) if met else ((), ())
            places.append(dataclasses.replace(place, families=numbers, times=times))
    kept = tuple(place for place in places if len(place.families) + len(place.equilibria) > 1)
    return Graph(families=several, equilibria=tuple(equilibria), places=kept)


def _places(families: Sequence[Family], equilibria: Sequence[EquilibriumFamily]) -> list[Place]:
    """The special points at which families may meet; one may appear several times."""
    found = []
    for i, family in enumerate(equilibria):
        for point in family.special:
            if point.kind == Kind.HOPF:
                scene = family.make(point.parameter)
                scene = scene.starting(point.state, 2 * math.pi / point.frequency)
                like = families[0].members[0].orbit
                at = dataclasses.replace(like, scene=scene, s_period=None, mesh=None)
                total = float(energy(scene, 0.0, scene.y0)) if scene.has_energy else math.nan
                place = Place(
                    kind=str(point.kind),
                    orbit=at,
                    parameter=point.parameter,
                    energy=total,
                    families=(),
                    times=(),
                    equilibria=(i,),
                    units=units_of(family.make, point).x,
                )
                found.append(place)
    kinds = (Kind.BRANCH, Kind.DOUBLING, Kind.REST)
    for kind, family in itertools.product(kinds, families):
        for member in family.special:
            if member.kind == kind:
                found.append(_place(member))
    return found


def _place(member: Member) -> Place:
    point = member.point
    parameter = 1.0 if math.isnan(member.parameter) else point.units[-2]
    return Place(
        kind=str(member.kind),
        orbit=member.orbit,
        parameter=member.parameter,
        energy=member.energy,
        families=(),
        times=(),
        units=np.append(point.sizes, parameter),
    )


def _arrivals(place: Place, family: Family) -> int:
    """How often a family's orbits trace the orbit of a place; 0 if the family does not reach it."""
    if any(_same(place, _place(member)) for member in family.special):
        return 1
    members = family.members
    if len(members) == 1:
        return 0
    for times in (1, 2) if place.kind == Kind.DOUBLING else (1,):
        if any(_leads(family, end, place, times) for end in (members[0], members[-1])):
            return times
    return 0


def _same(one: Place, two: Place) -> bool:
    """Whether two special points are the same orbit, at the same parameter."""
    assert one.units is not None
    assert two.units is not None
    *entry_sizes, unit = np.maximum(one.units, two.units)
    if abs(one.parameter - two.parameter) > _SAME * unit:
        return False
    if abs(one.period - two.period) > _SAME * one.period:
        return False
    resting = [place.kind in _RESTS for place in (one, two)]
    if any(resting):  # an orbit that has shrunk has no size
        off = np.asarray(one.orbit.y0) - np.asarray(two.orbit.y0)
        return all(resting) and bool(np.linalg.norm(off / entry_sizes) <= _SAME)
    return _apart(one.orbit, two.orbit) <= _SAME


def _apart(one: Orbit, two: Orbit) -> float:
    equations = Equations(scene=one.scene, closing=PLAIN)
    return distance(
        equations, np.append(np.asarray(one.y0), one.period), known_orbits([two], one.scene)
    )


def _leads(family: Family, end: Member, place: Place, times: int) -> bool:
    """Whether the family continues from an end to the place, its orbit traced `times` times."""
    period = times * place.period
    if abs(end.orbit.period - period) > _NEAR * period:
        return False
    equations = end.point.equations
    there = _unknowns(equations, end, place, period)
    surface, x = OrbitSurface(equations, end.orbit.rtol, GOAL), end.point.x
    near = _in_units_of(place, equations, there, end.point)
    units, ahead = near.units, end.tangent / near.units
    # The place must be near the end and ahead of it, up to directions that leave an orbit the same.
    # The distance of an orbit from the equilibrium that it surrounds is as large as its own size.
    neutral, reach = surface.neutral(near), 1.0 if place.kind in _RESTS else _NEAR
    off = (there - x) / units
    off = off - neutral @ (neutral.T @ off)
    length = float(np.linalg.norm(off))
    if length > reach or abs(ahead @ off) < _AHEAD * np.linalg.norm(ahead) * length:
        return False
    for _ in range(_HALVINGS):
        off = x - there
        length = float(np.linalg.norm(off / units))
        middle = there + 0.5 * off
        found = surface.nearest(middle, across=off, near=near)
        if found is None or np.linalg.norm((found.x - middle) / units) > _BENT * 0.5 * length:
            return False
        x = found.x
    return True


def _in_units_of(place: Place, equations: Equations, there: np.ndarray, point: Point) -> Point:
    """A point with units at least as large as at the place `there`, unless that is an equilibrium.

    An entry that is zero on one family and not on the other has no size of its own near the place.
    """
    if place.kind in _RESTS:
        return point
    known = unknown_sizes(equations, there, point.sizes)
    units = units_of_unknowns(equations, point.x, known)
    return dataclasses.replace(point, sizes=known.sizes, units=units)


def _unknowns(equations: Equations, end: Member, place: Place, period: float) -> np.ndarray:
    """The place as a solution of a family's equations, in the phase of a member near it."""
    orbit, y0 = place.orbit, np.asarray(place.orbit.y0)
    plain = equations.closing == PLAIN and not equations.driven
    if plain and place.kind not in _RESTS:
        ts = np.linspace(0.0, orbit.period, _SAMPLES, endpoint=False)
        ys = quick_solve(orbit.scene, orbit.period, ts=ts, rtol=orbit.rtol).ys
        off = differences(orbit.scene.system, ys, jnp.asarray(end.orbit.y0))
        shift = ts[np.argmin(np.linalg.norm(np.asarray(off) / end.point.sizes, axis=1))]
        y0 = np.asarray(quick_solve(orbit.scene, shift, rtol=orbit.rtol).y1) if shift else y0
    value = 0.0 if math.isnan(place.parameter) else place.parameter
    return equations.spread(y0, period, orbit.rtol, angle=orbit.angle, parameter=value)
