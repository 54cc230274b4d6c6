"""Families of periodic orbits, followed by pseudo-arclength in the space of all unknowns.

Each step is along the family, orthogonal to all directions that do not change the orbit, followed
by the shortest Newton steps back to the surface of solutions, which move neither along the family
nor along the symmetries. So no phase condition is needed, no unfolding parameter in conservative
scenes, where energy and period change along the family, and folds are regular points.

Special points follow from the non-trivial multipliers (`bifurcations`). At a simple one
`switch_branch` steps onto the other branch.

Reference: E. Doedel et al., AUTO-07P, and F. J. Munoz-Almaraz et al., Physica D 181 (2003) 1,
for conservative scenes.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from jaxdyn._checks import fail, positive, untraced, whole
from jaxdyn._records.captured import remembered
from jaxdyn._records.kinds import check_first
from jaxdyn.continuation.checkpoint import Begin, Log, kept_in
from jaxdyn.continuation.walk import Rules, walked
from orbits.closing.conditions import Hold, conditions
from orbits.families.bifurcations import drift, special_points
from orbits.families.chains import ChainSurface
from orbits.families.checkpoint import about, codec, what
from orbits.families.family import Family, Kind, Member
from orbits.families.isolas import met_again
from orbits.families.steps import first_member, in_segments, next_member, parameter_at, why_lost
from orbits.families.surface import OrbitSurface, Point, Surface
from orbits.hybrid.equations import Chain, MakeChain
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit, Outcome, SearchError
from orbits.shooting.equations import Equations
from orbits.shooting.finding import GOAL
from orbits.shooting.segment import Make
from orbits.shooting.segmentation import cut

#: At least, so that lengths and directions along a family are those of a whole motion: at a single
#: start a family turns, and may be stiff, for no other reason than where on the orbits that is.
_SEGMENTS = 4
#: A step is at most so many times as long as the one before, and longer only if the family will
#: bend by no more than this part of it, and multipliers will move no further than this: of two
#: special points in one step each may hide the other.
_GROW, _BENT, _DRIFT = 2.0, 0.05, 0.3
_SMALLEST = 1e-4  # of the first step: smallest step
#: Distances from a special point at which another branch is looked for, in turn.
_AMPLITUDES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
#: Of the amplitude: an orbit that is further from a special point is on another branch.
_BESIDE = 4.0
_NUDGE = 1e-6  # along a tangent, for a difference
_ANYWHERE = (-np.inf, np.inf)
_ENDS = {
    Kind.REST: "an equilibrium, to which the orbits shrink",
    Kind.GRAZING: "a grazed event, beyond which the chains are no motions",
}
_PASSED = "a bound of a leg, which the chains pass"
_NOT_SIMPLE = (
    "The closing equations leave one direction only here: this is not a simple branch point. "
    "At a torus point give times=q, where its multiplier is exp(2 pi i p / q)."
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
    down: bool = False,
    within: tuple[float, float] = _ANYWHERE,
    energies: tuple[float, float] = _ANYWHERE,
    hold: Hold = (),
    segments: int | None = None,
    goal: float = GOAL,
    report: Callable[[Member], None] = lambda member: None,
    path: str | Path | Log | None = None,
) -> Family:
    """The family of periodic orbits that an orbit belongs to.

    Args:
      orbit: its first member; what `find` or `find_hybrid` returned.
      make: the scene for each value of a parameter, e.g. a function ``mu -> van_der_pol(mu)``;
        its start and span do not matter. By default the family of a conservative scene along
        which energy and period change. For a chain of legs the legs, or the phases that it was
        found from: `scenes.phases_of` the scene with this value.
      parameter: the value of the parameter for `orbit`.
      step: length of the first step in the space of all unknowns, each in units of its size along
        the largest orbit so far (`orbits.closing.sizes`); the others are up to ten times as long.
      members: largest number of members.
      down: start towards a smaller parameter (without one: a shorter period).
      within: bounds on the parameter (without one: on the period); the family ends at the first
        member beyond them.
      energies: bounds on the energy of the members, likewise; not for chains.
      hold: conditions that all members satisfy besides closing, e.g. ``orbits.Energy(-1.0)``, or
        names of entries of the start that all have in common; not for chains.
      segments: at least, see `find`; where errors grow on the way orbits are cut into more; not for
        chains, whose legs are segments.
      goal: largest closing error of a member.
      report: called with each member as it is found.
      path: file (.jsonl) that keeps each member as it is found, and may keep several families; the
        same call goes on from it where it was interrupted. `orbits.families.load` reads it; not the
        families of chains, which hold numbers only.
    Returns:
      The members, and the special points between them.
    Raises:
      ValueError: `orbit` does not close, or belongs to no family; only one of `make` and
        `parameter` is given; `step`, `members` or a pair of bounds is out of range; a chain of legs
        is given without `make`, or with what is not for chains.
    Limits: host only. A family that closes upon itself ends where it meets its first member again.
      A family of chains ends where one grazes an event, since beyond they are no
      motions. A special point is detected where a multiplier changes sides between two
      members: of two that do so in one step one or none is found. One that cannot be located is
      left out.
    Example:
      >>> import numpy as np, orbits
      >>> from jaxdyn import scenes
      >>> swing = orbits.find(scenes.pendulum(angle=0.5), period=2.0)
      >>> family = orbits.continue_family(swing, members=5)
      >>> bool((np.diff(family.periods) > 0).all())
      True
    """
    untraced("continue_family", (orbit, parameter), "See orbits.differentiable, for each member.")
    _check(orbit, make, parameter, step, members)
    make = None if make is None else remembered("make", make)
    _check_bounds("within", within)
    _check_bounds("energies", energies)
    value = 0.0 if parameter is None else float(parameter)
    if isinstance(orbit, HybridOrbit):
        _check_chain(make, energies=energies != _ANYWHERE, hold=hold, segments=segments)
        chain = Chain.of(orbit, make)
        x = chain.pack(np.asarray(orbit.y0), orbit.spans, value)
        surface = ChainSurface(chain, orbit.rtol, goal)
    else:
        if energies != _ANYWHERE and not orbit.scene.has_energy:
            raise fail("energies", "none for a scene without an energy", energies, "Use `within`.")
        guess = np.append(np.asarray(orbit.y0), orbit.period)
        start = Equations.of(orbit, conditions(orbit.scene, hold), make)
        equations = cut(start, guess, orbit.rtol, segments, orbit.angle, value, least=_SEGMENTS)
        x = equations.spread(guess[:-1], guess[-1], orbit.rtol, orbit.angle, value)
        surface = OrbitSurface(equations, orbit.rtol, goal)
    point = surface.nearest(x)
    if point is None:
        remedy = "make(parameter) must be the orbit's scene, and `hold` hold for it."
        raise fail("orbit", "a solution of the closing equations", "none", remedy)
    first = first_member(surface, point, -1.0 if down else 1.0)
    if not first.stability.ok:
        report(first)
        end = f"the first orbit, whose multipliers are unknown: {first.stability.message}"
        return Family(members=(first,), special=(), end=end, equations=surface.equations)
    return _walked(surface, first, (step, members, within, energies), report, path)


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

    Args:
      family: the family of the point.
      special: one of ``family.special``.
      amplitude: distance from the point, in the space of the unknowns, each in units of its size;
        by default 0.01, or less where the branch bends sooner.
      times: periods after which the new orbits close: 2 at a period doubling, 1 at a branch
        point, q at a torus point where a multiplier is exp(2 pi i p / q).
      opposite: on the other half of the branch; as with a negative amplitude.
    Returns:
      (orbit, parameter); NaN for the parameter where the family has none.
    Raises:
      ValueError: `special` is an ordinary member, `times` > 1 where the family closes by a
        symmetry, or the closing of a chain of legs does not hold after so many periods.
      SearchError: no other branch was found.
    """
    if special.kind is None:
        raise fail("special", "one of family.special", "an ordinary member")
    times = times or (2 if special.kind == Kind.DOUBLING else 1)
    point, rtol = special.point, special.orbit.rtol
    old = point.equations
    kind = ChainSurface if isinstance(old, Chain) else OrbitSurface
    surface = kind(old.repeated(times), rtol, GOAL)
    if times > 1 and kind(old, rtol, GOAL).parts > 1:
        remedy = "Continue the family with plain closing."
        raise fail("times", "1 where orbits close by a symmetry", times, remedy)
    x = old.repeat(point.x, times, rtol)
    if isinstance(old, Chain) and not surface.holds(x):
        remedy = "Give none: then the difference of the states closes, angles up to whole turns."
        raise fail("closes", f"one that holds after {times} periods", "another one", remedy)
    ahead = old.repeat(point.x + _NUDGE * special.tangent, times, rtol)
    aside = surface.aside(x, ahead - x)
    if aside is None:
        raise SearchError(_NOT_SIMPLE)
    aside, here = -aside if opposite else aside, surface.point(x, point.residual, 0)
    for size in _AMPLITUDES if amplitude is None else (amplitude,):
        found = surface.nearest(x + size * aside, across=aside)
        # The known branch, which bends towards the other direction, is as far away there as the
        # root of the amplitude. A given one is taken as it is.
        beside = np.inf if amplitude is not None else _BESIDE * size
        if found is not None and here.distance(found.x) < beside:
            return surface.orbit(found), parameter_at(surface, found.x)
    raise SearchError(_NO_BRANCH if amplitude is not None else _NO_BRANCH_AT_ALL)


def _check(orbit, make, parameter, step, members) -> None:
    if not orbit.ok:
        raise fail("orbit", "an orbit that closes", orbit.message, "find() one first.")
    if (make is None) != (parameter is None):
        raise fail("parameter", "make and its value for the orbit, or neither", "only one")
    positive("step", step, "It is a length in the space of the unknowns.")
    whole("members", members)


def _check_chain(make, **more) -> None:
    if make is None:
        remedy = "Families of chains of legs are those in a parameter."
        raise fail("make", "the legs or phases for each value of a parameter", "none", remedy)
    for name, given in more.items():
        if given is not None and given is not False and given != ():
            raise fail(name, "none for a chain of legs", "one", "Leave it out.")


def _check_bounds(name: str, bounds) -> None:
    if not (len(bounds) == 2 and bounds[0] < bounds[1]):
        raise fail(name, "two bounds, the lower one first", bounds)


def _walked(surface: Surface, first: Member, limits, report, path) -> Family:
    step, most, within, energies = limits
    place = np.append(first.point.x, first.tangent)
    begin = Begin(what(surface), step, place, first, {} if path is None else about(surface))

    def after(member: Member) -> str:
        if not within[0] <= _measure(surface, member.point) <= within[1]:
            return f"the bounds {within}"
        if member.energy < energies[0] or member.energy > energies[1]:
            return f"the bounds on the energy, {energies}"
        return ""

    rules = Rules(
        following=lambda last, length: _next(surface.at(last.point), last, length),
        between=lambda a, b, fresh: special_points(surface.at(a.point), a, b),
        again=lambda a, b: met_again(surface.at(a.point), first, a, b),
        ready=lambda new: in_segments(surface, new),
        before=_last,
        after=after,
        lost=lambda last, length: why_lost(surface.at(last.point), last, length),
        shortest=_SMALLEST,
    )
    with kept_in(path, begin, codec(surface)) as (first, kept):
        found = walked(rules, first, step, most, report, kept)
    return Family(found.members, found.special, found.end, surface.equations)


def _last(new: Member, special: list[Member]) -> str:
    """Why a family ends before a member; empty if it does not."""
    ends = [_ENDS[x.kind] for x in special if x.kind in _ENDS]
    passed = new.orbit.outcome == Outcome.BOUND_PASSED
    return ends[0] if ends else _PASSED if passed else ""


def _next(surface: Surface, last: Member, step: float) -> tuple[Member | None, float]:
    """The member a step further along the family, and by what the next step may be longer."""
    member = next_member(surface, last, step)
    if member is None:
        return None, 1.0
    bent = last.point.distance(member.point.x - step * last.tangent) / step
    least = max(1 / _GROW, bent / _BENT, drift(last, member) / _DRIFT)
    return member, max(1.0, 1 / least)


def _measure(surface: Surface, point: Point) -> float:
    """The quantity of `within` and `down`: the parameter, or the period."""
    make = surface.equations.make
    return float(point.x[-1] if make is None else parameter_at(surface.at(point), point.x))
