"""The equilibrium between two members of a family, to which its orbits shrink.

Beyond it the family would continue with the same orbits, half a period later, with the flow at the
start reversed. Steps along the family do not find it: each is across the flow at its own start, so
that they may pass beside the equilibrium. Instead an orbit is shrunk towards it. A family that
comes near an equilibrium without shrinking, as towards a homoclinic orbit, is recognised by its
period, which is not that of small oscillations.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.continuation import newton
from jaxdyn.continuation.kinds import Kind
from orbits.families.family import Member
from orbits.families.steps import member_at, parameter_at
from orbits.families.surface import Point, Surface

_NEWTON_STEPS = 20
_RANK = 1e-9  # smaller singular values of the Jacobian, relatively, do not move the state
#: Distance, in steps of the family, at which an equilibrium is looked for before it is passed,
#: since steps that become ever shorter may not pass it.
_AHEAD = 1.0
#: The orbit is shrunk to this part of its radius, but to no less than this part of the size of the
#: equilibrium: periods are wrong by the square of the radius, and by rounding divided by it.
_SMALLER, _SMALLEST = 1e-4, 3e-5
_TIMES = 3  # steps in which it is shrunk: the equilibrium moves with the parameter
_OFF_RESONANCE = 1e-3  # largest error of the equilibrium's multipliers over the orbit's period
#: The same for an orbit that is almost an ellipse, and the relative error of the linear flow there.
_ELLIPSE = 0.1
_NUDGE = 1e-6  # length along a tangent, for a difference quotient


def equilibrium_between(surface: Surface, a: Member, b: Member) -> Member | None:
    """A tiny orbit about the equilibrium between two neighbours, or ahead of the second one.

    It keeps the tangent and the directions of the first neighbour. None if orbits do not shrink
    there.
    """
    if not surface.shrinks:
        return None
    # Lengths of states and of unknowns are in the units of the first neighbour.
    entry_sizes = a.point.sizes
    (here, flow), (there, next_flow) = (_start(surface, m.point.x, entry_sizes) for m in (a, b))
    speed, along = float(flow @ flow), float(next_flow @ flow)
    length = a.point.distance(b.point.x)
    radius = float(np.linalg.norm(next_flow)) * b.orbit.period / (2 * np.pi)
    passed = along < 0
    if not (passed or (radius < _AHEAD * length and next_flow @ next_flow < speed)):
        return None
    nearest = here + speed / (speed - along) * (there - here) if passed else there
    rest = _equilibrium(_scene(surface, a.point.x), nearest * entry_sizes, entry_sizes)
    if rest is None:
        return None
    rest = rest / entry_sizes
    radii = [float(np.linalg.norm(y - rest)) for y in (here, there)]
    if min(radii) > (1.0 if passed else _AHEAD) * length or not (passed or radii[1] < radii[0]):
        return None
    # Shrink the nearer orbit, unless it is the equilibrium itself up to rounding.
    goal = max(_SMALLER * max(radii), _SMALLEST * float(np.linalg.norm(rest)))
    point = b.point if radii[0] < goal or goal < radii[1] < radii[0] else a.point
    point = _shrunk(surface, point, (rest * entry_sizes, entry_sizes), goal, _AHEAD * length)
    if point is None or not _resonant(surface, point, rest * entry_sizes):
        return None
    point = dataclasses.replace(point, units=a.point.units)
    member = member_at(surface, point, a.tangent / point.units, a.alike / point.units[:, None])
    return dataclasses.replace(member, kind=Kind.REST) if member.stability.ok else None


def shrinks_ahead(surface: Surface, member: Member) -> bool:
    """Whether an orbit is almost an ellipse about an equilibrium, and shrinks along its tangent.

    This is decided to first order, however short the steps are: along the tangent the distances of
    the orbit's states from the equilibrium have to become smaller.
    """
    if not surface.shrinks:
        return False
    x, entry_sizes = member.point.x, member.point.sizes
    (here, flow), scene = _start(surface, x, entry_sizes), _scene(surface, x)
    rest = _equilibrium(scene, here * entry_sizes, entry_sizes)
    if rest is None:
        return False
    slope = map_in_units(np.asarray(_linearize(scene, rest)[1]), entry_sizes)
    bent = np.linalg.norm(flow - slope @ (here - rest / entry_sizes))
    round_it = bent <= _ELLIPSE * np.linalg.norm(flow)
    if not (round_it and _resonant(surface, member.point, rest, _ELLIPSE)):
        return False
    ahead = x + _NUDGE * member.tangent
    moved = _equilibrium(_scene(surface, ahead), rest, entry_sizes)
    if moved is None:
        return False
    off = (_states(surface, x) - rest) / entry_sizes
    change = (_states(surface, ahead) - moved) / entry_sizes - off
    # The change has a part along the flow, since the tangent is across the flow; by Schwarz's
    # inequality it is the smaller part here.
    return bool(np.sum(off * change) < 0)


def _states(surface: Surface, x: np.ndarray) -> np.ndarray:
    """(s, k) the states at which the segments of an orbit begin."""
    between = np.asarray(surface.equations.unpack(x).between)
    return np.vstack([surface.equations.start_at(x), *between])


def _shrunk(
    surface: Surface,
    point: Point,
    near: tuple[np.ndarray, np.ndarray],
    goal: float,
    most: float,
) -> Point | None:
    """The orbit of a family whose start is at a distance `goal` from an equilibrium.

    The equilibrium is near the first item of `near` (k,), and the distance is in the sizes that are
    its second item (k,). None if the orbit is not found with unknowns that change by at most `most`
    in each step.
    """
    equations, (rest, entry_sizes) = surface.equations, near
    for left in range(_TIMES, 0, -1):
        exact = _equilibrium(_scene(surface, point.x), rest, entry_sizes)
        if exact is None:
            return None
        rest, unknowns = exact, equations.unpack(point.x)
        between = np.asarray(unknowns.between)
        radius = equations.start_at(point.x) - rest
        if not radius.any():
            return None
        factor = (goal / float(np.linalg.norm(radius / entry_sizes))) ** (1 / left)
        smaller = equations.pack(
            rest + factor * radius,
            rest + factor * (between - rest),
            *(float(x) for x in (unknowns.angle, unknowns.parameter, unknowns.period)),
        )
        across = equations.pack(radius, 0.0 * between, 0.0, 0.0, 0.0)
        found = surface.nearest(smaller, across=across, near=point)
        if found is None or point.distance(found.x) > most:
            return None
        point = found
    return point


def _resonant(
    surface: Surface, point: Point, rest: np.ndarray, most: float = _OFF_RESONANCE
) -> bool:
    """Whether linear oscillations about an equilibrium close after the period of a tiny orbit."""
    unknowns = surface.equations.unpack(point.x)
    slope = np.asarray(_linearize(_scene(surface, point.x), rest)[1])
    values = np.linalg.eigvals(slope)
    values = values[values.imag > 0]
    turned = np.exp(1j * float(unknowns.angle))
    ends = np.exp(values * float(unknowns.period))
    off = [np.abs(ends - turned), np.abs(ends - np.conj(turned))]
    return bool(np.min(off, initial=np.inf) < most)


def _scene(surface: Surface, x: np.ndarray) -> Scene:
    return surface.equations.scene_at(jnp.asarray(parameter_at(surface, x)))


def _start(
    surface: Surface, x: np.ndarray, entry_sizes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(k,) the start at x and the flow there, in sizes (k,)."""
    y = surface.equations.start_at(x)
    return y / entry_sizes, np.asarray(_linearize(_scene(surface, x), y)[0]) / entry_sizes


def _equilibrium(scene: Scene, y: np.ndarray, entry_sizes: np.ndarray) -> np.ndarray | None:
    """(k,) the equilibrium near a state; None if Newton's method does not converge.

    Lengths are in sizes `entry_sizes` (k,). `jaxdyn.analysis.equilibria.equilibrium` would not do,
    since it rejects equilibria that are not isolated, as those of bodies that may be anywhere.
    """

    def equations(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        flow, slope = map(np.asarray, _linearize(scene, z * entry_sizes))
        return flow / entry_sizes, map_in_units(slope, entry_sizes)

    found = newton.solve(equations, y / entry_sizes, steps=_NEWTON_STEPS, rank=_RANK, polish=1)
    return found.x * entry_sizes if found.settled else None


@jax.jit
def _linearize(scene: Scene, y: Array) -> tuple[Array, Array]:
    """The flow (k,) at a state, and its derivative (k, k)."""
    return value_and_jacfwd(lambda y: scene.rate(jnp.zeros(()), y))(y)
