"""Families of periodic orbits, followed by pseudo-arclength in the space of all unknowns.

Each predictor step is along the family, orthogonal to all directions that do not change the orbit.
It is followed by the shortest Newton steps back to the surface of solutions, which move neither
along the family nor along the symmetries. So no phase condition is needed, and no unfolding
parameter in conservative scenes, where energy and period change along the family; folds are regular
points.

Special points follow from the non-trivial multipliers (`bifurcations`). At a simple branch point
`switch_branch` steps onto the other branch.

Reference: E. Doedel et al., AUTO-07P, and F. J. Munoz-Almaraz et al., Physica D 181 (2003) 1,
for conservative scenes.
"""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxdyn._checks import check_first, check_on_host, fail, positive, whole
from jaxdyn._records import with_captures
from jaxdyn._text import flag, number_of
from jaxdyn.continuation.branch import (
    ANYWHERE,
    Bounded,
    BranchProblem,
    check_bounds,
    follow,
    inside,
)
from jaxdyn.continuation.checkpoint import Codec, Log
from jaxdyn.continuation.kinds import Kind
from jaxdyn.scene import Scene
from orbits.analysis.same import same_orbit
from orbits.closing.closings import Hold, conditions
from orbits.closing.given import loses_drive
from orbits.families import checkpoint
from orbits.families.bifurcations import leaves_open, special_points, zero_between
from orbits.families.chains import ChainSurface
from orbits.families.family import Family, Member
from orbits.families.shrinking import shrinks_ahead
from orbits.families.steps import OrbitChart, first_member, in_segments, moved_to, parameter_at
from orbits.families.surface import OrbitSurface, Point, Surface
from orbits.hybrid.equations import ChainEquations, MakeChain
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit, Outcome, SearchError
from orbits.shooting.equations import Equations
from orbits.shooting.finding import GOAL
from orbits.shooting.segment import Make, OwnNumber
from orbits.shooting.segmentation import cut_into_segments

# ---- Families that close upon themselves (isolas): the first orbit again
#
# A step that passes the first member approaches it from behind. Where any point of an orbit may be
# its start, this shows in the parameter and the period, otherwise in all unknowns. If the orbit
# there is the first one, the family is closed.


def first_met_again(surface: Surface, first: Member, a: Member, b: Member) -> Member | None:
    """The first member where the family passes it again between two neighbours; None if not."""

    def compared(point: Point, x: np.ndarray) -> np.ndarray:
        if surface.shrinks:
            return x[-1:] if surface.equations.make is None else x[-2:]
        return point.equations.place(x)

    here = first.point
    x0, tangent, units = (compared(here, x) for x in (here.x, first.tangent, here.units))

    def offset(member: Member) -> np.ndarray:
        return (compared(member.point, member.point.x) - x0) / units

    def along(_: Surface, member: Member) -> float:
        return float(tangent / units @ offset(member))

    if not along(surface, a) < 0 <= along(surface, b):
        return None
    length = np.linalg.norm(offset(b) - offset(a))
    if max(np.linalg.norm(offset(member)) for member in (a, b)) > 2 * length:
        return None
    found = zero_between(surface, a, b, along)
    if found is None or not (found.orbit.ok and first.orbit.ok):
        return None
    return found if same_orbit(first.orbit, found.orbit) else None


# ---- Families of periodic orbits, followed by pseudo-arclength in the space of all unknowns

#: Fewest segments, so that lengths and directions along a family are those of a whole motion: at a
#: single start a family may turn, or need tiny steps, merely because of where that start lies.
_SEGMENTS = 4
#: Distances from a special point at which another branch is looked for, in turn.
_AMPLITUDES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
#: An orbit further from a special point than this multiple of the amplitude is on another branch.
_BESIDE = 4.0
_NUDGE = 1e-6  # length along a tangent, for a difference quotient
#: Points at which a multiplier is 1.
_AT_ONE = (Kind.FOLD, Kind.BRANCH)
_ENDS = {
    Kind.REST: "an equilibrium, to which the orbits shrink",
    Kind.GRAZING: "a grazed event, beyond which the chains are not motions",
}
#: Relative difference up to which the members of a family have one value of its parameter.
_SAME_VALUE = 1e-10
_AT_ONE_VALUE = (
    "; the parameter does not change along the family: orbits close at this value only, as without "
    "damping, or by a symmetry"
)
_PASSED = "a bound of a leg, which the chains pass"
_UNBOUNDED = "a motion so large that its drive is rounding beside it"
_NOT_SIMPLE = (
    "The closing equations leave one direction only here: this is not a simple branch point. "
    "At a torus point give times=q, where its multiplier is exp(2 pi i p / q); orbits.torus finds "
    "the tori that begin there."
)
_NOT_SYMMETRIC = (
    "The closing equations leave one direction only here: orbits on the other branch lack the "
    "symmetry by which those of this family close, as axial orbits lack that of planar ones at the "
    "xz plane. Find the first orbit again with plain closing, or with a symmetry of both branches, "
    "and continue that."
)
_NO_BRANCH = (
    "No orbit was found along the second direction at this distance. The other branch may bend "
    "away from it: try a smaller amplitude, or leave it out."
)
_NO_BRANCH_AT_ALL = (
    "No orbit was found along the second direction, at distances from 0.01 down to 1e-5. Two "
    "special points may be too close to each other: take shorter steps, or give an amplitude."
)


@check_first
def continue_family(
    orbit: Orbit | HybridOrbit,
    make: Make | MakeChain | None = None,
    parameter: float | None = None,
    *,
    step: float = 0.05,
    members: int = 50,
    down: bool | None = None,
    within: tuple[float, float] = ANYWHERE,
    energies: tuple[float, float] = ANYWHERE,
    hold: Hold = (),
    segments: int | None = None,
    goal: float = GOAL,
    report: Callable[[Member], None] = lambda member: None,
    path: str | Path | Log | None = None,
) -> Family:
    """The family of periodic orbits that an orbit belongs to.

    Args:
      orbit: its first member; a result of `find` or `find_hybrid`.
      make: the scene for each value of a parameter, e.g. a function ``mu -> van_der_pol(mu)``;
        its start and span do not matter. The default is the family of a conservative scene along
        which energy and period change. For a chain of legs it makes the legs, or the phases from
        which it was found: `scenes.phases_of` the scene with this value.
      parameter: the value of the parameter for `orbit`.
      step: length of the first step in the space of all unknowns, each in units of its size along
        the largest orbit so far (`orbits.closing.sizes`); later steps are up to ten times as long.
      members: largest number of members.
      down: start towards a smaller parameter, or without one towards a shorter period; False for
        a larger or longer one. The default is False, except from a small orbit about an
        equilibrium, as `from_hopf` finds it: then the family leads away from the equilibrium.
      within: bounds on the parameter, or without one on the period; a family that leaves them ends
        with the member on the bound.
      energies: bounds on the energy of the members, likewise; not for chains.
      hold: conditions that all members satisfy besides closing, e.g. ``orbits.Energy(-1.0)``, or
        names of entries of the start that all members have in common; not for chains.
      segments: least number of segments, see `find`; where errors grow along the family, orbits are
        cut into more. Not for chains, whose legs are segments.
      goal: largest residual of a member, as in `find`.
      report: called with each member as it is found.
      path: file (.jsonl) to which each member is written as it is found, and which may hold several
        families; the same call resumes from it where it was interrupted. `orbits.families.load`
        reads it, but not families of chains, since the file holds only numbers.
    Returns:
      The members, and the special points between them.
    Raises:
      ValueError: `orbit` does not close, or belongs to no family; only one of `make` and
        `parameter` is given; `step`, `members` or a pair of bounds is out of range; a chain of legs
        is given without `make`, or with an argument that is not for chains.
    Limits: host only. A family that closes upon itself ends where it meets its first member again.
      A family of chains ends where one grazes an event, since beyond it they are not motions. A
      special point is detected where a multiplier changes sides between two members: if two do so
      in one step, one or none is found. A special point that cannot be located is left out.
    Example:
      >>> import numpy as np, orbits
      >>> from jaxdyn import scenes
      >>> swing = orbits.find(scenes.pendulum(angle=0.5), period=2.0)
      >>> family = orbits.continue_family(swing, members=5)
      >>> bool((np.diff(family.periods) > 0).all())
      True
    """
    check_on_host(
        "continue_family", (orbit, parameter), "See orbits.differentiable, for each member."
    )
    _check(orbit, make, parameter, step, members)
    if make is not None and not isinstance(make, OwnNumber):
        make = with_captures(make, "parameter")
    check_bounds("within", within)
    check_bounds("energies", energies)
    if down is not None:
        flag("down", down)
    value = 0.0 if parameter is None else float(parameter)
    number, what = (orbit.period, "period") if parameter is None else (value, "parameter")
    if not inside(number, within):
        wanted = f"bounds around the {what} of the orbit, {number:.6g}"
        raise fail("within", wanted, tuple(within))
    if isinstance(orbit, HybridOrbit):
        _check_chain(make, energies=energies != ANYWHERE, hold=hold, segments=segments)
        chain = ChainEquations.of(orbit, make)
        x = chain.pack(np.asarray(orbit.y0), orbit.spans, value)
        surface = ChainSurface(chain, orbit.rtol, goal)
    else:
        if energies != ANYWHERE and not orbit.scene.has_energy:
            raise fail("energies", "none for a scene without an energy", energies, "Use `within`.")
        guess = np.append(np.asarray(orbit.y0), orbit.period)
        start = Equations.of(orbit, conditions(orbit.scene, hold, (orbit.closing,)), make)
        equations = cut_into_segments(
            start, guess, orbit.rtol, segments, orbit.angle, value, least=_SEGMENTS
        )
        x = equations.spread(guess[:-1], guess[-1], orbit.rtol, orbit.angle, value)
        surface = OrbitSurface(equations, orbit.rtol, goal)
    point = surface.nearest(x)
    if point is None:
        remedy = "make(parameter) must be the orbit's scene, and `hold` hold for it."
        raise fail("orbit", "a solution of the closing equations", "none", remedy)
    first = first_member(surface, point, -1.0 if down else 1.0)
    if down is None and shrinks_ahead(surface, first):
        first = dataclasses.replace(first, tangent=-first.tangent)
    if not first.stability.ok:
        report(first)
        end = f"the first orbit, whose multipliers are unknown: {first.stability.message}"
        return Family(members=(first,), special=(), end=end, equations=surface.equations)
    found = follow(_Problem(surface, within, energies), first, step, members, report, path)
    end = found.end + (_AT_ONE_VALUE if _stays(found.members) else "")
    return Family(found.members, found.special, end, surface.equations)


def _stays(members: Sequence[Member]) -> bool:
    """Whether the parameter of a family, if it has one, is the same for all of its members."""
    values = np.array([member.parameter for member in members])
    return len(values) > 2 and bool(np.ptp(values) <= _SAME_VALUE * np.abs(values).max())


@check_first
def switch_branch(
    family: Family,
    special: Member,
    *,
    amplitude: float | None = None,
    times: int | None = None,
    opposite: bool = False,
) -> tuple[Orbit | HybridOrbit, float]:
    """An orbit on the other branch through a special point, and its parameter.

    Equilibria have `jaxdyn.continuation.switch_branch`.

    Args:
      family: the family of the point.
      special: a special point, one of ``family.special``.
      amplitude: distance from the point, in the space of the unknowns, each in units of its size;
        by default 0.01, or less where the branch bends sooner.
      times: periods after which the new orbits close: 2 at a period doubling, 1 at a branch
        point, q at a torus point where a multiplier is exp(2 pi i p / q).
      opposite: take the other half of the branch, as with a negative amplitude.
    Returns:
      (orbit, parameter); NaN for the parameter where the family has none.
    Raises:
      ValueError: `special` is an ordinary member, `times` > 1 where the family closes by a
        symmetry, or the closing of a chain of legs does not hold after that many periods.
      SearchError: no other branch was found.
    """
    if special.kind is None:
        raise fail("special", "one of family.special", "an ordinary member")
    times = times or (2 if special.kind == Kind.DOUBLING else 1)
    point, rtol = special.point, special.orbit.rtol
    old = point.equations
    kind = ChainSurface if isinstance(old, ChainEquations) else OrbitSurface
    surface = kind(old.over_periods(times), rtol, GOAL)
    if times > 1 and kind(old, rtol, GOAL).parts > 1:
        remedy = "Continue the family with plain closing."
        raise fail("times", "1 where orbits close by a symmetry", times, remedy)
    x = old.repeat(point.x, times, rtol)
    if isinstance(old, ChainEquations) and not surface.holds(x):
        remedy = "Give none: then the difference of the states closes, angles up to whole turns."
        raise fail("closes", f"one that holds after {times} periods", "another one", remedy)
    ahead = old.repeat(point.x + _NUDGE * special.tangent, times, rtol)
    aside = surface.other_direction(x, ahead - x, point.sizes)
    if aside is None:
        symmetric = special.kind == Kind.BRANCH and kind(old, rtol, GOAL).parts > 1
        raise SearchError(_NOT_SYMMETRIC if symmetric else _NOT_SIMPLE)
    aside = -aside if opposite else aside
    here = surface.point(x, point.residual, 0, point.sizes)
    for size in _AMPLITUDES if amplitude is None else (amplitude,):
        found = surface.nearest(x + size * aside, across=aside, near=point)
        # The known branch, if it bends towards the other direction, is farther away there: by about
        # the square root of the amplitude. With a given amplitude any orbit is accepted.
        beside = np.inf if amplitude is not None else _BESIDE * size
        if found is not None and here.distance(found.x) < beside:
            return surface.orbit(found), parameter_at(surface, found.x)
    raise SearchError(_NO_BRANCH if amplitude is not None else _NO_BRANCH_AT_ALL)


def _check(orbit, make, parameter, step, members) -> None:
    if not orbit.ok:
        raise fail("orbit", "an orbit that closes", orbit.message, "find() one first.")
    if (make is None) != (parameter is None):
        raise fail("parameter", "make and its value for the orbit, or neither", "only one")
    if callable(make) and isinstance(orbit, Orbit):
        made = make(parameter)
        if not isinstance(made, Scene):
            raise fail("make(parameter)", "a Scene", type(made).__name__)
        entries = [len(scene.y0) for scene in (orbit.scene, made)]
        if entries[0] != entries[1]:
            wanted, got = (number_of(n, "entry", "entries") for n in entries)
            raise fail("make(parameter)", f"the orbit's scene, with {wanted}", f"one with {got}")
    positive("step", step, "It is a length in the space of the unknowns.")
    whole("members", members)


def _check_chain(make, **more) -> None:
    if make is None:
        remedy = "Families of chains of legs are those in a parameter."
        raise fail("make", "the legs or phases for each value of a parameter", "none", remedy)
    for name, given in more.items():
        if given is not None and given is not False and given != ():
            raise fail(name, "none for a chain of legs", "one", "Leave it out.")


class _Problem(BranchProblem[Member]):
    """A family of orbits within bounds on its parameter or period, and on the energy."""

    def __init__(self, surface: Surface, within, energies):
        self.surface, self.within, self.energies = surface, within, energies
        self.what = checkpoint.what(surface)
        #: The last member whose multipliers are certainly on one side of 1, while those of the
        #: members since are not, and no point has been found at which one is 1; else None.
        self.known: Member | None = None

    def chart(self, member: Member) -> OrbitChart:
        return OrbitChart(self.surface.at(member.point), member)

    def codec(self) -> Codec:
        return checkpoint.codec(self.surface)

    def about(self) -> dict[str, Any]:
        return checkpoint.about(self.surface)

    def identity(self, first: Member, member: Member) -> np.ndarray:
        del first  # its unknowns are in the units of the problem
        return np.append(member.point.x, member.tangent)

    def special(self, chart: OrbitChart, a, b, first: bool) -> list[Member]:
        found = special_points(chart.surface, a, b)
        start, self.known = self.known, None
        if any(x.kind in _AT_ONE for x in found):
            return found
        if leaves_open(chart.surface, b):
            self.known = a if start is None else start
            return found
        if start is None:
            return found
        surface = self.surface.at(start.point)
        same = moved_to(surface, b)  # since `start` the orbits may have been cut again
        missed = [] if same is None else special_points(surface, start, same)
        return [*found, *(x for x in missed if x.kind in _AT_ONE)]

    def again(self, chart: OrbitChart, first, a, b) -> Member | None:
        return first_met_again(chart.surface, first, a, b)

    def end_before(self, new: Member, special: list[Member]) -> str:
        ends = [_ENDS[x.kind] for x in special if x.kind in _ENDS]
        if ends:
            return ends[0]
        if new.orbit.outcome == Outcome.BOUND_PASSED:
            return _PASSED
        return _UNBOUNDED if self._loses_drive(new.orbit) else ""

    def _loses_drive(self, orbit: Orbit | HybridOrbit) -> bool:
        """Whether the drive is rounding error, as soon near a resonance without damping."""
        equations = self.surface.equations
        if isinstance(equations, ChainEquations) or not equations.driven:
            return False
        return loses_drive(orbit.scene, float(orbit.period))

    def bounded(self, chart: OrbitChart, member: Member) -> list[Bounded]:
        energy = Bounded(member.energy, self.energies, "on the energy, ")
        if self.surface.equations.make is None:
            return [Bounded(member.orbit.period, self.within, units=chart.units[-1]), energy]
        return [Bounded(member.parameter, self.within, units=chart.units[-2]), energy]

    def lost(self, reason: str) -> str:
        return f"no orbit was found beyond: {reason}"

    def ready(self, member: Member) -> Member:
        return in_segments(self.surface, member)
