"""Steps along a family: the member at a point of the surface of solutions, and the next one."""

import dataclasses

import jax.numpy as jnp
import numpy as np
from scipy.optimize import linear_sum_assignment

from jaxdyn import Status
from jaxdyn._checks import fail
from jaxdyn.analysis import energy
from jaxdyn.continuation.branch import Chart, Correction, Place
from orbits.families.family import Member
from orbits.families.surface import Point, Surface

#: A step is at most `_GROW` times as long as the one before. It is longer than that one only if the
#: family is expected to bend by no more than the share `_BENT` of the step, and multipliers to move
#: no further than `_DRIFT`: two special points in one step may hide each other.
_GROW, _BENT, _DRIFT = 2.0, 0.05, 0.3
#: A step in which a multiplier moves further than this may have left the family.
_LEAP = 1.0
#: Parts of a step between two members that are tried, the longest first: near a collision Newton's
#: method needs short ones.
_PARTS = (1.0, 0.5, 0.25, 0.125)
#: Growth of errors over an orbit above which doubles hold few digits of it, or none.
_UNHOLDABLE = 1e12
_NUDGE = 1e-6  # length along a tangent, for a difference quotient
_FLAT = 1e-9  # a period or parameter that changes less is constant
_STILL_FLAT = 1e-5  # the same if it was constant: near a branch point rounding of directions grows


def first_member(surface: Surface, point: Point, sign: float) -> Member:
    """The member at a point; its tangent leads to a larger parameter or period for sign 1.

    Raises:
      ValueError: the point belongs to no family.
    """
    basis = surface.directions(point)
    if not basis.shape[1]:
        remedy = "Follow it over a number of the scene, parameter=, or give fewer conditions."
        raise fail("orbit", "a member of a family", "an isolated one", remedy)
    # Of several directions, take the one along which the parameter, or the period, changes most.
    entry = basis[-1] if surface.equations.make is None else basis[-2]
    tangent = basis @ entry if np.linalg.norm(entry) > _FLAT else basis[:, -1]
    tangent = sign * tangent / np.linalg.norm(tangent)
    nothing = np.zeros((len(tangent), 0))
    member = member_at(surface, point, tangent, nothing)
    alike = _fixed_parameter_directions(surface, basis)
    # A direction within one scene needs an integral. Those that the scene names account for some.
    unnamed = alike.shape[1] - (member.stability.integrals - member.stability.unnamed)
    if not member.stability.ok or unnamed <= 0:
        return member
    return member_at(surface, point, tangent, _align(alike, tangent)[:, :unnamed])


class OrbitChart(Chart[Member]):
    """A family near a member, in the units of that member.

    Each step ends at the nearest solution: the corrector moves neither along the family nor along
    directions that leave the orbit the same.

    Attributes:
      surface: the surface of solutions, in the segments of the member.
      units: (n,) units of the unknowns.
      known: whether the multipliers of members must be known: without them no special point would
        be detected.
    """

    resolution = 1e-12  # integrations are not more accurate

    def __init__(self, surface: Surface, member: Member, *, known: bool = True):
        self.surface, self.units, self.known = surface, member.point.units, known

    def place(self, member: Member) -> Place:
        return Place(member.point.x / self.units, member.tangent / self.units)

    def correct(self, last: Member, start, plane) -> Correction | str:
        predicted = start * self.units
        point = self.surface.nearest(predicted, near=last.point)
        if point is None:
            # Where families meet, Newton's shortest steps may alternate between them.
            point = self.surface.nearest(predicted, last.tangent, near=last.point)
        if point is None:
            reason, other = self._why_lost(last, predicted), self.surface.alternative
            return f"{reason}; {other}" if other else reason
        return Correction(point.x / self.units, point.iterations, point)

    def tangent(self, last: Member, found: Correction) -> np.ndarray | str:
        point = found.solution
        if self.surface.is_equilibrium(point):
            return "an equilibrium"
        before = last.tangent / point.units
        tangent = _nearest(self.surface.directions(point), before[:, None] / np.linalg.norm(before))
        if not tangent.shape[1]:
            return "the family turns within the shortest step, or meets another one"
        return point.units * tangent[:, 0] / self.units

    def cosine(self, last: Member, found: Correction, tangent: np.ndarray) -> float:
        # Use the units of the new point: after a close passage sizes differ.
        units = found.solution.units
        a, b = last.tangent / units, tangent * self.units / units
        return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))

    def member(self, last: Member, found: Correction, tangent: np.ndarray) -> Member | str:
        point = found.solution
        old = _orthonormal(last.alike / point.units[:, None])
        alike = old
        if alike.shape[1]:
            basis = self.surface.directions(point)
            alike = _nearest(_fixed_parameter_directions(self.surface, basis, _STILL_FLAT), old)
        if alike.shape[1] < last.alike.shape[1]:
            return "an integral of the family is lost"
        new = member_at(self.surface, point, tangent * self.units / point.units, alike)
        return new if new.stability.ok or not self.known else "multipliers are unknown"

    def growth(self, last: Member, new: Member, iterations: int, bent: float) -> float:
        least = max(1 / _GROW, bent / _BENT, drift(last, new) / _DRIFT)
        return max(1.0, 1 / least)

    def is_in_doubt(self, last: Member, new: Member) -> bool:
        # In a canard explosion orbits of two kinds nearly coincide at their starts.
        return drift(last, new) > _LEAP

    def between(self, a: Member, b: Member, share: float) -> Member | None:
        # If Newton's method fails, a shorter step may succeed, or one from the other end.
        attempts = (
            one for part in _PARTS for one in ((a, b, part * share), (b, a, part * (1 - share)))
        )
        return next((found for one in attempts if (found := self._towards(*one))), None)

    def _towards(self, a: Member, b: Member, share: float) -> Member | None:
        length = share * a.point.along(a.tangent, b.point.x)
        found = OrbitChart(self.surface, a, known=self.known).step(a, length)
        return None if isinstance(found, str) else found.member

    def _why_lost(self, last: Member, predicted: np.ndarray) -> str:
        status = self.surface.status(predicted)
        if status != Status.OK:
            return f"the motion does not last a period ({status.name.lower().replace('_', ' ')})"
        if self.surface.step_error(predicted) > self.surface.goal:
            return "errors of the steps of collocation exceed the goal"
        reason, growth = "Newton's method does not converge", last.stability.growth
        lost = growth > _UNHOLDABLE
        return f"{reason}, since errors grow by {growth:.0e} over an orbit" if lost else reason


def drift(a: Member, b: Member) -> float:
    """The farthest that a multiplier moves between two members; infinite if that is unknown.

    It is measured on the Riemann sphere, since changes of multipliers near zero and infinity have
    no effect. Multipliers are paired so that they move least, since their order by size may change.
    """
    one, two = (member.stability.nontrivial for member in (a, b))
    if len(one) != len(two):
        return np.inf
    away = np.hypot(1.0, np.abs(one))[:, None] * np.hypot(1.0, np.abs(two))
    moved = 2 * np.abs(two - one[:, None]) / away
    if not np.isfinite(moved).all():
        return np.inf
    return float(moved[linear_sum_assignment(moved)].max(initial=0.0))


def in_segments(surface: Surface, member: Member) -> Member:
    """The member in segments that suit it: it is cut again if errors grow strongly over one."""
    new = surface.recut(member.point)
    return member if new is None else moved_to(new, member) or member


def moved_to(new: Surface, member: Member) -> Member | None:
    """The member in the segments of a surface; None if Newton's method does not find it there."""
    old = member.point
    if old.equations is new.equations:
        return member
    known = old.equations.move_to(old.x, new.equations, new.rtol)
    point = new.nearest(known, near=old)
    if point is None:
        return None

    def directions(old_basis: np.ndarray) -> np.ndarray:
        ahead = (old.x + _NUDGE * way for way in old_basis.T)
        moved = [old.equations.move_to(x, new.equations, new.rtol) - known for x in ahead]
        return np.reshape(moved, (len(moved), known.size)).T / point.units[:, None] / _NUDGE

    basis = new.directions(point)
    along = directions(member.tangent[:, None])
    tangent = _nearest(basis, along / np.linalg.norm(along))
    alike = _nearest(
        _fixed_parameter_directions(new, basis), _orthonormal(directions(member.alike))
    )
    if not tangent.shape[1] or alike.shape[1] < member.alike.shape[1]:
        return None
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
        orbit=surface.judge(orbit, known),
        parameter=parameter_at(surface, point.x),
        energy=total,
        stability=known,
        point=point,
        tangent=tangent,
        alike=alike,
    )


def _fixed_parameter_directions(
    surface: Surface, basis: np.ndarray, flat: float = _FLAT
) -> np.ndarray:
    """(n, d) orthonormal: the directions along which the parameter is constant."""
    if surface.equations.make is None or not basis.shape[1]:
        return basis
    change = basis[-2]
    if np.linalg.norm(change) <= flat:
        return basis
    _, _, vt = np.linalg.svd(change[None])
    return basis @ vt[1:].T


def _align(basis: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """The same space, with the direction nearest to the tangent first."""
    _, _, vt = np.linalg.svd((basis.T @ tangent)[None])
    return basis @ vt.T


def _orthonormal(basis: np.ndarray) -> np.ndarray:
    return np.linalg.qr(basis)[0]


def _nearest(basis: np.ndarray, old: np.ndarray) -> np.ndarray:
    """(n, p) orthonormal: the part of the span of directions (n, d) nearest to the old (n, p).

    At a branch point that span has one more dimension than the old one.
    """
    u, s, vt = np.linalg.svd(basis @ (basis.T @ old), full_matrices=False)
    kept = s > 0.5
    return u[:, kept] @ vt[kept] if kept.all() else u[:, kept]
