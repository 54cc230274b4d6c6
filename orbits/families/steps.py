"""Steps along a family: the member at a point of the surface of solutions, and the next one."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxdyn import Status
from jaxdyn._checks import fail
from jaxdyn.analysis import energy
from orbits.families.family import Member
from orbits.families.surface import Point, Surface

_TURN = 0.9  # smallest cosine between tangents of neighbours: 26 degrees
#: Growth of errors over an orbit with which doubles hold few digits of it, or none.
_UNHOLDABLE = 1e12
_NUDGE = 1e-6  # along a tangent, for a difference
_FLAT = 1e-9  # a period or parameter that changes less is constant


def first_member(surface: Surface, point: Point, sign: float) -> Member:
    """The member at a point, whose tangent leads to a larger parameter or period for sign 1.

    Raises:
      ValueError: the point belongs to no family.
    """
    ways = surface.directions(point)
    if not ways.shape[1]:
        remedy = "Give make and parameter, or fewer conditions."
        raise fail("orbit", "a member of a family", "an isolated one", remedy)
    # Of several directions that of the largest change of the parameter, or the period.
    entry = ways[-1] if surface.equations.make is None else ways[-2]
    tangent = ways @ entry if np.linalg.norm(entry) > _FLAT else ways[:, -1]
    tangent = sign * tangent / np.linalg.norm(tangent)
    nothing = np.zeros((len(tangent), 0))
    member = member_at(surface, point, tangent, nothing)
    alike = _same_scene(surface, ways)
    # A family within one scene needs an integral. Each one that the scene names accounts for one.
    unnamed = alike.shape[1] - (member.stability.integrals - member.stability.unnamed)
    if not member.stability.ok or unnamed <= 0:
        return member
    return member_at(surface, point, tangent, _aligned(alike, tangent)[:, :unnamed])


def next_member(
    surface: Surface, last: Member, step: float, *, known: bool = True
) -> Member | None:
    """The member a step further along the family, or back; None if it is not found.

    Its multipliers must be `known`: without them no special point would be detected.
    """
    point = _point_beyond(surface, last, step)
    if point is None or surface.rests(point):
        return None
    ways = surface.directions(point)
    tangent = _further(ways, last, point)
    if tangent is None:
        return None
    old = _orthonormal(last.alike / point.units[:, None])
    alike = _nearest(_same_scene(surface, ways), old)
    if alike.shape[1] < last.alike.shape[1]:
        return None
    member = member_at(surface, point, tangent, alike)
    return member if member.stability.ok or not known else None


def why_lost(surface: Surface, last: Member, step: float) -> str:
    """Why there is no `next_member` after a step, even a short one, in words."""
    ahead = last.point.x + step * last.tangent
    status = surface.status(ahead)
    if status != Status.OK:
        reason = f"the motion does not last a period ({status.name.lower().replace('_', ' ')})"
    elif not (point := _point_beyond(surface, last, step)):
        reason = "Newton's method does not converge"
        if last.stability.growth > _UNHOLDABLE:
            reason += f", since errors grow by {last.stability.growth:.0e} over an orbit"
    elif surface.rests(point):
        reason = "an equilibrium"
    elif _further(surface.directions(point), last, point) is None:
        reason = "the family turns within the shortest step, or meets another one"
    else:
        reason = "multipliers are unknown"
    return f"no orbit was found beyond: {reason}"


def _further(ways: np.ndarray, last: Member, point: Point) -> np.ndarray | None:
    """(n,) the tangent at a point, of its directions (n, d); None if the family turns too much."""
    before = last.tangent / point.units
    before = before / np.linalg.norm(before)
    tangent = _nearest(ways, before[:, None])
    if not tangent.shape[1] or tangent[:, 0] @ before < _TURN:
        return None
    return tangent[:, 0]


def _point_beyond(surface: Surface, last: Member, step: float) -> Point | None:
    """The solution near the place a step along the tangent; None if there is none as near."""
    predicted = last.point.x + step * last.tangent
    point = surface.nearest(predicted, near=last.point)
    if point is None:
        # Where families meet, Newton's shortest steps may alternate between them.
        point = surface.nearest(predicted, last.tangent, near=last.point)
    # Orbits that grow from an equilibrium take longer steps; those that shrink do not take shorter
    # ones, with which they would never arrive.
    if point is None or np.linalg.norm((point.x - predicted) / last.point.units) > abs(step):
        return None
    return point


def in_segments(surface: Surface, member: Member) -> Member:
    """The member in segments that suit it: where errors grow much in one it is cut again."""
    old, new = member.point, surface.recut(member.point)
    if new is None:
        return member
    known = old.equations.moved(old.x, new.equations, surface.rtol)
    point = new.nearest(known, near=old)
    if point is None:
        return member

    def directions(old_ways: np.ndarray) -> np.ndarray:
        ahead = (old.x + _NUDGE * way for way in old_ways.T)
        moved = [old.equations.moved(x, new.equations, surface.rtol) - known for x in ahead]
        return np.reshape(moved, (len(moved), known.size)).T / point.units[:, None] / _NUDGE

    ways = new.directions(point)
    along = directions(member.tangent[:, None])
    tangent = _nearest(ways, along / np.linalg.norm(along))
    alike = _nearest(_same_scene(new, ways), _orthonormal(directions(member.alike)))
    if not tangent.shape[1] or alike.shape[1] < member.alike.shape[1]:
        return member
    tangent, alike = point.units * tangent[:, 0], point.units[:, None] * alike
    return dataclasses.replace(member, point=point, tangent=tangent, alike=alike)


def parameter_at(surface: Surface, x: np.ndarray) -> float:
    """The parameter of the family at a point; NaN if it has none."""
    equations = surface.equations
    return float("nan") if equations.make is None else float(equations.unpack(x).parameter)


def member_at(surface: Surface, point: Point, tangent: np.ndarray, alike: np.ndarray) -> Member:
    """The member at a point, with its tangent and the directions to orbits of the same scene.

    The tangent (n,) and the directions (n, p) are given in units.
    """
    tangent, alike = point.units * tangent, point.units[:, None] * alike
    orbit = surface.orbit(point)
    scene = surface.scene(orbit)
    total = float(energy.energy(scene, jnp.zeros(()), orbit.y0)) if scene.has_energy else np.nan
    known = surface.stability(orbit, point, alike)
    return Member(
        orbit=surface.judged(orbit, known),
        parameter=parameter_at(surface, point.x),
        energy=total,
        stability=known,
        point=point,
        tangent=tangent,
        alike=alike,
    )


def _same_scene(surface: Surface, ways: np.ndarray) -> np.ndarray:
    """(n, d) orthonormal: those of the directions along which the parameter is constant."""
    if surface.equations.make is None or not ways.shape[1]:
        return ways
    change = ways[-2]
    if np.linalg.norm(change) <= _FLAT:
        return ways
    _, _, vt = np.linalg.svd(change[None])
    return ways @ vt[1:].T


def _aligned(ways: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """The same space, with the direction nearest to the tangent first."""
    _, _, vt = np.linalg.svd((ways.T @ tangent)[None])
    return ways @ vt.T


def _orthonormal(ways: np.ndarray) -> np.ndarray:
    return np.linalg.qr(ways)[0]


def _nearest(ways: np.ndarray, old: np.ndarray) -> np.ndarray:
    """(n, p) orthonormal: of the space of the directions (n, d), that nearest to the old (n, p).

    At a branch point the space has one more dimension than the old one.
    """
    u, s, vt = np.linalg.svd(ways @ (ways.T @ old), full_matrices=False)
    kept = s > 0.5
    return u[:, kept] @ vt[kept] if kept.all() else u[:, kept]
