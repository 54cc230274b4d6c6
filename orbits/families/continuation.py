"""Families of periodic orbits, followed by pseudo-arclength in the space of all unknowns.

Each step is along the family, orthogonal to all directions that do not change the orbit, followed
by the shortest Newton steps back to the surface of solutions, which move neither along the family
nor along the symmetries. So no phase condition is needed, no unfolding parameter in conservative
scenes, where energy and period change along the family, and folds are regular points.

Special points follow from the non-trivial multipliers: one through +1 is a branch point (or a
fold), one through -1 a period doubling, complex ones leaving the unit circle a torus point. At a
simple one `switch_branch` steps onto the other branch.

Reference: E. Doedel et al., AUTO-07P, and F. J. Munoz-Almaraz et al., Physica D 181 (2003) 1,
for conservative scenes.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from jaxdyn._checks import fail, positive, untraced, whole
from jaxdyn.analysis import energy
from orbits.analysis.stability import stability
from orbits.closing.conditions import Hold, conditions
from orbits.families.bifurcations import NUDGE, TESTS
from orbits.families.family import Family, Kind, Member
from orbits.families.surface import Point, Surface
from orbits.orbit import Orbit, SearchError
from orbits.shooting.cuts import cut
from orbits.shooting.equations import Equations
from orbits.shooting.finding import GOAL
from orbits.shooting.pieces import Make

_EASY = 4  # with at most this many Newton steps the next step may be longer
_GROW, _SHRINK = 1.5, 0.5
_TURN = 0.9  # smallest cosine between tangents of neighbours: 26 degrees
_SMALLEST = 1e-3  # of the first step: smallest step
_BISECTIONS = 40  # of a step, to find a special point in it
_LONGEST = 10.0  # of the first step: longest step
_CLOSE = 1e-9  # relative: where the bisection ends
_ANYWHERE = (-np.inf, np.inf)
_FLAT = 1e-9  # a period or parameter that changes less is constant
_NOT_SIMPLE = (
    "The closing equations leave one direction only here: this is not a simple branch point. "
    "At a torus point give times=q, where its multiplier is exp(2 pi i p / q)."
)
_NO_BRANCH = (
    "No orbit was found along the second direction at this distance. The other branch may bend "
    "away from it: try a smaller amplitude."
)


def continue_family(
    orbit: Orbit,
    make: Make | None = None,
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
) -> Family:
    """The family of periodic orbits that an orbit belongs to.

    Args:
      orbit: its first member; what `find` returned.
      make: the scene for each value of a parameter, e.g. a function ``mu -> van_der_pol(mu)``;
        its start and span do not matter. By default the family of a conservative scene along
        which energy and period change.
      parameter: the value of the parameter for `orbit`.
      step: length of the first step in the space of all unknowns; the others are up to ten
        times as long.
      members: largest number of members.
      down: start towards a smaller parameter (without one: a shorter period).
      within: bounds on the parameter (without one: on the period); the family ends at the first
        member beyond them.
      energies: bounds on the energy of the members, likewise.
      hold: conditions that all members satisfy besides closing, e.g. ``orbits.Energy(-1.0)``, or
        names of entries of the start that all have in common.
      segments: see `find`.
      goal: largest closing error of a member.
      report: called with each member as it is found.
    Returns:
      The members, and the special points between them.
    Raises:
      ValueError: `orbit` does not close, or belongs to no family; only one of `make` and
        `parameter` is given; `step`, `members` or a pair of bounds is out of range.
    Limits: host only. A special point is detected where a multiplier changes sides between two
      members; two that do so in one step are detected as one.
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
    _check_bounds("within", within)
    _check_bounds("energies", energies)
    if energies != _ANYWHERE and not orbit.scene.has_energy:
        raise fail("energies", "none for a scene without an energy", energies, "Use `within`.")
    value = 0.0 if parameter is None else float(parameter)
    guess = np.append(np.asarray(orbit.y0), orbit.period)
    start = Equations.of(orbit, conditions(orbit.scene, hold), make)
    equations = cut(start, guess, orbit.rtol, segments, orbit.angle, value)
    x = equations.spread(guess[:-1], guess[-1], orbit.rtol, orbit.angle, value)
    surface = Surface(equations, orbit.rtol, goal)
    point = surface.nearest(x)
    if point is None:
        remedy = "make(parameter) must be the orbit's scene, and `hold` hold for it."
        raise fail("orbit", "a solution of the closing equations", "none", remedy)
    first = _member(surface, point, _outward(surface, point, -1.0 if down else 1.0))
    report(first)
    if not first.stability.ok:
        end = f"the first orbit, whose multipliers are unknown: {first.stability.message}"
        return Family(members=(first,), special=(), end=end, equations=equations)
    return _walked(surface, first, step, members, (within, energies), report)


def switch_branch(
    family: Family, special: Member, *, amplitude: float = 1e-2, times: int | None = None
) -> tuple[Orbit, float]:
    """An orbit on the other branch through a special point, and its parameter.

    Args:
      family: the family of the point.
      special: one of ``family.special``.
      amplitude: distance from the point, in the space of the unknowns; the other half of the
        branch has the opposite sign.
      times: periods after which the new orbits close: 2 at a period doubling, 1 at a branch
        point, q at a torus point where a multiplier is exp(2 pi i p / q).
    Returns:
      (orbit, parameter); NaN for the parameter where the family has none.
    Raises:
      ValueError: `special` is an ordinary member, or `times` > 1 where the family closes by a
        symmetry.
      SearchError: no other branch was found.
    """
    if special.kind is None:
        raise fail("special", "one of family.special", "an ordinary member")
    times = times or (2 if special.kind == Kind.DOUBLING else 1)
    old, point, rtol = family.equations, special.point, special.orbit.rtol
    if times > 1 and old.closing.parts > 1:
        remedy = "Continue the family with plain closing."
        raise fail("times", "1 where orbits close by a symmetry", times, remedy)
    equations = old.repeated(times)
    surface = Surface(equations, rtol, GOAL)
    x = old.repeat(point.x, times, rtol)
    ahead = old.repeat(point.x + NUDGE * special.tangent, times, rtol)
    aside = surface.aside(x, ahead - x)
    if aside is None:
        raise SearchError(_NOT_SIMPLE)
    found = surface.nearest(x + amplitude * aside, across=aside)
    if found is None:
        raise SearchError(_NO_BRANCH)
    return surface.orbit(found), _parameter(equations, found.x)


def _check(orbit, make, parameter, step, members) -> None:
    if not orbit.ok:
        raise fail("orbit", "an orbit that closes", orbit.message, "find() one first.")
    if (make is None) != (parameter is None):
        raise fail("parameter", "make and its value for the orbit, or neither", "only one")
    positive("step", step, "It is a length in the space of the unknowns.")
    whole("members", members)


def _check_bounds(name: str, bounds) -> None:
    if not (len(bounds) == 2 and bounds[0] < bounds[1]):
        raise fail(name, "two bounds, the lower one first", bounds)


def _walked(surface: Surface, first: Member, step, most, bounds, report) -> Family:
    within, energies = bounds
    members, special = [first], []
    shortest, longest = _SMALLEST * step, _LONGEST * step
    end = f"the number of members requested, {most}"
    while len(members) < most:
        last = members[-1]
        member = _next(surface, last, step)
        if member is None:
            step *= _SHRINK
            if step < shortest:
                end = "no orbit was found beyond: a collision, a rest point, or the step limit"
                break
            continue
        special += _between(surface, last, member)
        members.append(member)
        report(member)
        if not within[0] <= _measure(surface, member.point) <= within[1]:
            end = f"the bounds {within}"
            break
        if member.energy < energies[0] or member.energy > energies[1]:
            end = f"the bounds on the energy, {energies}"
            break
        if member.point.iterations <= _EASY:
            step = min(_GROW * step, longest)
    return Family(
        members=tuple(members), special=tuple(special), end=end, equations=surface.equations
    )


def _next(surface: Surface, last: Member, step: float, kind: Kind | None = None) -> Member | None:
    """The member a step further along the family; None if there is none."""
    predicted = last.point.x + step * last.tangent
    point = surface.nearest(predicted)
    if point is None or np.linalg.norm(point.x - predicted) > step:
        return None
    tangent = _onward(surface, point, last.tangent)
    if tangent is None or tangent @ last.tangent < _TURN:
        return None
    member = _member(surface, point, tangent, kind)
    # Without multipliers no special point would be detected.
    return member if member.stability.ok else None


def _member(
    surface: Surface, point: Point, tangent: np.ndarray, kind: Kind | None = None
) -> Member:
    orbit = surface.orbit(point)
    scene = orbit.scene
    total = float(energy.energy(scene, jnp.zeros(()), orbit.y0)) if scene.has_energy else np.nan
    parameter = _parameter(surface.equations, point.x)
    return Member(
        orbit=orbit,
        parameter=parameter,
        energy=total,
        stability=stability(orbit, throw=False),
        point=point,
        tangent=tangent,
        kind=kind,
    )


def _parameter(equations: Equations, x: np.ndarray) -> float:
    return float("nan") if equations.make is None else float(equations.unpack(x).parameter)


def _measure(surface: Surface, point: Point) -> float:
    """The quantity of `within` and `down`: the parameter, or the period."""
    equations = surface.equations
    return float(point.x[-1] if equations.make is None else _parameter(equations, point.x))


def _outward(surface: Surface, point: Point, sign: float) -> np.ndarray:
    ways = surface.directions(point)
    if not ways.shape[1]:
        remedy = "Give make and parameter, or fewer conditions."
        raise fail("orbit", "a member of a family", "an isolated one", remedy)
    # Of several directions that of the largest change of the parameter, or the period.
    entry = ways[-1] if surface.equations.make is None else ways[-2]
    tangent = ways @ entry if np.linalg.norm(entry) > _FLAT else ways[:, -1]
    return sign * tangent / np.linalg.norm(tangent)


def _onward(surface: Surface, point: Point, tangent: np.ndarray) -> np.ndarray | None:
    ways = surface.directions(point)
    along = ways @ (ways.T @ tangent)
    size = np.linalg.norm(along)
    return along / size if size > 0 else None


def _between(surface: Surface, a: Member, b: Member) -> list[Member]:
    """The special points between two neighbours, each found by bisection."""
    found = []
    for kind, test in TESTS.items():
        if test(surface, a) * test(surface, b) < 0:
            point = _bisected(surface, a, b, kind, test)
            if point is not None:
                found.append(point)
    folds = [f for f in found if f.kind == Kind.FOLD]
    # At a fold a multiplier passes through +1 as well.
    return folds + [
        f for f in found if f.kind != Kind.FOLD and not (folds and f.kind == Kind.BRANCH)
    ]


def _bisected(surface: Surface, a: Member, b: Member, kind: Kind, test) -> Member | None:
    low, length = a, float(a.tangent @ (b.point.x - a.point.x))
    side, best = test(surface, a), None
    for _ in range(_BISECTIONS):
        length *= 0.5
        middle = _next(surface, low, length, kind)
        if middle is None:
            return best
        best = middle
        if test(surface, middle) * side > 0:
            low = middle
        if length < _CLOSE * (1.0 + np.linalg.norm(low.point.x)):
            break
    return best
