"""Special points of a family: they are detected between two members, and located.

Most kinds have a test function of the members, which changes sign where a family passes such a
point (`_TESTS`); its zero is located by steps along the family. Multipliers that leave the unit
circle in pairs are counted instead, and the point is located by bisection. If two leave through 1
or -1 within a step, the step is halved until each leaves in a part of its own; two that leave at
the same place, as they may in a symmetric scene, are located by bisection too. Where rounding
leaves the sign of a test open, as for a multiplier of 1e29 +- 3e29 near a homoclinic orbit, nothing
is found.

- Fold: the parameter, or else the energy (or the first integral, in a scene without an energy),
  is stationary along the family. A multiplier is 1 there.
- Branch point: a non-trivial multiplier passes through 1, and a second family crosses. Along the
  bent branch of a pitchfork it reaches 1 and turns back, and the parameter is stationary.
- Period doubling: a multiplier passes through -1.
- Equilibrium: the orbits have shrunk to nothing, and the family ends (`shrinking`).
- Torus point: a complex pair crosses the unit circle.
- Grazing: a chain of legs meets an event at zero speed, or touches a bound of a leg. Beyond it the
  chain is not a motion, and the family ends.
- Krein collision: two complex pairs on the unit circle meet and leave it, as they can in
  conservative scenes.
"""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.analysis import energy
from jaxdyn.continuation.kinds import Kind
from orbits.families.family import Member
from orbits.families.shrinking import equilibrium_between
from orbits.families.steps import OrbitChart
from orbits.families.surface import Surface
from orbits.shooting.equations import Equations

#: An integral that changes along the family by less than this share of its gradient is constant.
_CONSTANT = 1e-11
_STEPS = 40  # steps of a bisection
#: A test counts as zero below this share of the larger of its values at the two neighbours.
_ZERO = 1e-3
#: Relative distance below which two special points are one.
_SAME_PLACE = 1e-5
#: Bars wider than this leave open on which side of a critical value a multiplier is.
_VAGUE = 0.1
#: Families cross at a point whose distance from a crossing (`Surface.crossing`) is below this share
#: of that of its neighbours.
_CROSSED = 1e-4
#: They do not cross where it is above this share: a crossing blurred by rounding is still nearer.
_FAR = 0.5
#: Most halvings of a step in which special points may hide each other.
_HALVINGS = 16

Test = Callable[[Surface, Member], float]


def special_points(
    surface: Surface, a: Member, b: Member, halvings: int = _HALVINGS
) -> list[Member]:
    """The special points between two neighbours."""
    rest = equilibrium_between(surface, a, b)
    if rest is not None:
        # Beyond the equilibrium orbits repeat, and at it other tests vanish at resonances.
        point = zero_between(surface, a, rest, _TESTS[Kind.DOUBLING])
        doublings = [] if point is None else [_with_kind(surface, Kind.DOUBLING, point)]
        return [*(x for x in doublings if not _same(x, rest)), rest]
    if halvings and _hide_each_other(surface, a, b) and not _same(a, b):
        middle = OrbitChart(surface, a).between(a, b, 0.5)
        if middle is not None:
            halves = ((a, middle), (middle, b))
            return [x for half in halves for x in special_points(surface, *half, halvings - 1)]
    certain = _known_tests(surface, a, b)
    places = [
        (kind, zero_between(surface, a, b, _TESTS[kind])) for kind in _TESTS if kind in certain
    ]
    fold = next((point for kind, point in places if kind == Kind.FOLD), None)
    if fold is not None and _bends(surface, a, b, fold, certain):
        places = [(Kind.BRANCH, fold) if kind == Kind.FOLD else (kind, x) for kind, x in places]
    if _turns_steeply(surface, a, b, dict(places), certain):
        places = [(Kind.FOLD if kind == Kind.BRANCH else kind, x) for kind, x in places]
    found = [_with_kind(surface, kind, point) for kind, point in places if point is not None]
    if _leave_in_pairs(surface, a, b):
        found += _boundary(surface, a, b)
    grazings = _grazings(surface, a, b)
    found += grazings
    folds = [x for x in found if x.kind == Kind.FOLD]
    # At a fold a multiplier passes through 1 as well.
    found = [x for x in found if x.kind != Kind.BRANCH or not any(_same(x, f) for f in folds)]
    found = sorted(found, key=lambda x: a.point.along(a.tangent, x.point.x))
    # Beyond a grazed event there is no motion to have special points.
    grazed = [x.kind for x in found].index(Kind.GRAZING) + 1 if grazings else None
    return found[:grazed]


def _grazings(surface: Surface, a: Member, b: Member) -> list[Member]:
    """The members between two others that graze an event."""
    found = []
    for i in range(len(surface.margins(a.orbit))):
        # A grazed event has no multipliers.
        point = zero_between(surface, a, b, lambda s, x, i=i: s.margins(x.orbit)[i], known=False)
        found += [] if point is None else [dataclasses.replace(point, kind=Kind.GRAZING)]
    return found


def zero_between(
    surface: Surface, a: Member, b: Member, test: Test, *, known: bool = True
) -> Member | None:
    """The member between two others where a test is zero; None if there is none."""

    def value(member: Member) -> float:
        return test(surface, member)

    small = _ZERO * max(abs(value(a)), abs(value(b)))
    best = OrbitChart(surface, a, known=known).locate(value, a, b)
    if best is None or abs(value(best)) > small:
        return None
    # If there are more, rounding hides that one belongs to the flow or a symmetry: it is not a
    # critical one.
    most = max(len(member.stability.nontrivial) for member in (a, b))
    return None if known and len(best.stability.nontrivial) > most else best


def _boundary(surface: Surface, a: Member, b: Member) -> list[Member]:
    """The member between two others where multipliers leave the circle in pairs, by bisection.

    The list is empty if it is not found.
    """
    chart, start = OrbitChart(surface, a), a
    for _ in range(_STEPS):
        member = None if chart.at_end(a, b, 0.5) else chart.between(a, b, 0.5)
        if member is None:
            break
        a, b = (a, member) if _leave_in_pairs(surface, start, member) else (member, b)
    if not _same(a, b):
        return []
    # Where the scene is symmetric, two may leave through 1 or -1 at the same place.
    kind = _leave_along_axis(start, b) or _pair_kind(a, b)
    return [dataclasses.replace(b, kind=kind)]


def _same(a: Member, b: Member) -> bool:
    # The distance is measured along the family: an orbit may also be found at another phase.
    return abs(a.point.along(a.tangent, b.point.x)) < _SAME_PLACE * (1.0 + a.point.size)


def _bends(surface: Surface, a: Member, b: Member, fold: Member, certain: set[Kind]) -> bool:
    """Whether a family turns where another one crosses it, as the bent branch of a pitchfork does.

    At a fold a multiplier passes through 1; at such a point it reaches 1 and turns back.
    """
    test = _TESTS[Kind.BRANCH]
    if Kind.BRANCH not in certain or test(surface, a) * test(surface, b) < 0:
        return False
    # A fold and a branch point may lie in one step, as on the way to a homoclinic orbit.
    here, beside = _distances_from_crossing(surface, fold, a, b)
    return here < _CROSSED * beside


def _turns_steeply(
    surface: Surface, a: Member, b: Member, places: dict[Kind, Member | None], certain: set[Kind]
) -> bool:
    """Whether a multiplier passes through 1 at a fold near which the parameter hardly changes.

    In a canard explosion the change of the parameter along the family is no more than rounding,
    which leaves the place of a fold open; the multiplier shows it.
    """
    point = places.get(Kind.BRANCH)
    if point is None or Kind.FOLD in certain or surface.equations.make is None:
        return False
    if not _fold(surface, a) * _fold(surface, b) < 0:
        return False
    here, beside = _distances_from_crossing(surface, point, a, b)
    return here > _FAR * beside


def _distances_from_crossing(
    surface: Surface, point: Member, a: Member, b: Member
) -> tuple[float, float]:
    """The distance from a crossing of families, and the larger one at two neighbours."""
    here, *beside = (surface.at(x.point).crossing(*_place(x))[0] for x in (point, a, b))
    return here, max(beside)


def _place(member: Member) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where a member is, the direction of its family, and the sizes of its entries."""
    return member.point.x, member.tangent, member.point.sizes


def _with_kind(surface: Surface, kind: Kind, point: Member) -> Member:
    """The point with its kind."""
    # Where no second family crosses, an integral that the scene does not name is stationary: that
    # is a fold. (Closing by a symmetry hides families without the symmetry.)
    hidden = point.alike.shape[1] and surface.parts == 1
    if kind == Kind.BRANCH and hidden and surface.other_direction(*_place(point)) is None:
        kind = Kind.FOLD
    return dataclasses.replace(point, kind=kind)


def _fold(surface: Surface, member: Member) -> float:
    """The change of the parameter, or else of an integral, along the family."""
    if surface.equations.make is not None:
        return float(member.tangent[-2])
    gradient = np.asarray(_gradient(surface.equations, member.point.x)) * member.point.units
    slope = float(gradient @ (member.tangent / member.point.units))
    return slope if abs(slope) > _CONSTANT * np.linalg.norm(gradient) else 0.0


@jax.jit
def _gradient(equations: Equations, x: Array) -> Array:
    """(n,) the gradient of the energy, or of the first integral that is a number, at x."""

    def integral(x: Array) -> Array:
        found = energy.integrals(equations.scene, jnp.zeros(()), equations.start(x))
        return next((i for i in found.values() if i.ndim == 0), jnp.zeros(()))

    return jax.grad(integral)(x)


def _through(value: float) -> Test:
    return lambda _, member: float(np.prod(member.stability.nontrivial - value).real)


def _branch(surface: Surface, member: Member) -> float:
    """The product of the multipliers minus 1; the determinant of the equations if one stays at 1.

    One stays at 1 along the orbits about a centre, as those of van der Pol's oscillator at mu = 0:
    only the equations show where its limit cycles begin, by their derivative with respect to mu.
    """
    if member.alike.shape[1] and surface.equations.make is not None:
        found = surface.bordered_determinant(member.point, member.tangent)
        if not np.isnan(found):
            return found
    return _through(1.0)(surface, member)


#: The critical multiplier where a family meets another one.
_MET = {Kind.BRANCH: 1.0, Kind.DOUBLING: -1.0}
#: Test functions of a member, which change sign at special points.
_TESTS = {Kind.FOLD: _fold, Kind.BRANCH: _branch, Kind.DOUBLING: _through(-1.0)}


def _known_tests(surface: Surface, a: Member, b: Member) -> set[Kind]:
    """The tests whose signs are known at both neighbours."""
    return {kind for kind in _TESTS if all(_is_sign_certain(kind, surface, end) for end in (a, b))}


def leaves_open(surface: Surface, member: Member) -> bool:
    """Whether rounding leaves open on which side of 1 a multiplier of a member is."""
    return not _is_sign_certain(Kind.BRANCH, surface, member)


def _is_sign_certain(kind: Kind, surface: Surface, member: Member) -> bool:
    """Whether the sign of a test is known in spite of rounding."""
    if kind == Kind.FOLD:
        whole = member.tangent / member.point.units
        steady = _CONSTANT * float(np.linalg.norm(whole) * member.point.units[-2])
        return surface.equations.make is None or abs(_fold(surface, member)) > steady
    known = member.stability
    near = np.abs(known.nontrivial - _MET[kind]) <= known.bars
    return not ((known.bars > _VAGUE) & near).any()


def _leave_in_pairs(surface: Surface, a: Member, b: Member) -> bool:
    """Whether multipliers have left the unit circle between two members, but not at +1 or -1.

    At +1 and -1 they leave it one by one. Pairs that meet off the circle do not change the number
    of multipliers outside.
    """
    for known in (a.stability, b.stability):
        near_circle = np.abs(np.abs(known.nontrivial) - 1) <= known.bars
        if ((known.bars > _VAGUE) & near_circle).any():
            return False
    change = abs(int(_is_outside(a).sum()) - int(_is_outside(b).sum()))
    return change - _count_at_plus_minus_one(surface, a, b) >= 2


def _count_at_plus_minus_one(surface: Surface, a: Member, b: Member) -> int:
    """The number of the points +1 and -1 at which multipliers have crossed the unit circle."""
    certain = _known_tests(surface, a, b) & _MET.keys()
    return sum(_TESTS[kind](surface, a) * _TESTS[kind](surface, b) < 0 for kind in certain)


def _hide_each_other(surface: Surface, a: Member, b: Member) -> bool:
    """Whether special points between two members may hide each other.

    A pair that leaves the circle may hide one that returns through +1 or -1, and two multipliers
    that leave through the same one of these points do not change the sign of its test.
    """
    if _leave_along_axis(a, b) is not None and _leave_in_pairs(surface, a, b):
        return True
    spiralling = [np.sum(_is_outside(member) & ~_is_real(member)) for member in (a, b)]
    return spiralling[0] != spiralling[1] and _count_at_plus_minus_one(surface, a, b) > 0


def _leave_along_axis(a: Member, b: Member) -> Kind | None:
    """The kind of point through which two or more multipliers have left the unit circle, if any."""
    for kind, value in _MET.items():
        if abs(_count_beyond(a, value) - _count_beyond(b, value)) >= 2:
            return kind
    return None


def _count_beyond(member: Member, value: float) -> int:
    """The number of real multipliers beyond 1 or -1."""
    beyond = _is_outside(member) & _is_real(member)
    return int(np.sum(beyond & (value * member.stability.nontrivial.real > 0)))


def _is_real(member: Member) -> np.ndarray:
    """(p,) whether each multiplier is real."""
    return np.abs(member.stability.nontrivial.imag) <= member.stability.bars


def _is_outside(member: Member) -> np.ndarray:
    """(p,) whether each multiplier is outside of the unit circle."""
    return np.abs(member.stability.nontrivial) - 1 > member.stability.bars


def _pair_kind(a: Member, b: Member) -> Kind:
    """How multipliers left the circle in pairs; at a Krein collision they go to both sides.

    Since both members are next to the collision, reciprocals are recognised by their distance.
    """
    outer = max(a, b, key=lambda member: int(_is_outside(member).sum()))
    values = outer.stability.nontrivial
    mirrored = [
        np.abs(values - 1 / np.conj(v)).min() < abs(v) - 1 for v in values[_is_outside(outer)]
    ]
    return Kind.KREIN if all(mirrored) else Kind.TORUS
