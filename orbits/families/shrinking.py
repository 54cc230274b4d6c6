"""The equilibrium between two members of a family, to which its orbits shrink.

Beyond it the family would go on with the same orbits, half a period later: there the flow at the
start is reversed. It is not found by steps along the family, which may pass beside it, since each
is across the flow at its own start; instead an orbit is shrunk towards it.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene
from orbits.families.family import Kind, Member
from orbits.families.steps import member_at, parameter_at
from orbits.families.surface import Surface

_NEWTON_STEPS = 20
_SOLVED = 1e-12  # relative: the last of these steps
_RANK = 1e-9  # relative: smaller singular values of the Jacobian leave the state where it is
#: Radius of an orbit, relative to the size of its start, at which a family that shrinks ends.
_TINY = 1e-3
_OFF = 5.0  # such radii: the farthest that a start may be, on a long ellipse
#: Radius, relative to the size of the equilibrium, to which orbits are shrunk, in so many times,
#: since the equilibrium of another parameter is elsewhere. Its square and the rounding of a state
#: over it are what periods there are wrong by.
_SMALL, _TIMES = 1e-5, 3


def rest_between(surface: Surface, a: Member, b: Member) -> Member | None:
    """A tiny orbit about an equilibrium between two neighbours, or beside the second; or None."""
    equations = surface.equations
    if equations.driven:
        return None
    (here, flow), (there, next_flow) = (_start(surface, member.point.x) for member in (a, b))
    along, back = flow @ flow, next_flow @ flow
    # Shorter and shorter steps may end there without passing it.
    radius = float(np.linalg.norm(next_flow)) * b.orbit.period / (2 * np.pi)
    small = _TINY * (1 + float(np.linalg.norm(there)))
    if not (back < 0 or (radius < small and next_flow @ next_flow < along)):
        return None
    nearest = there if back >= 0 else here + along / (along - back) * (there - here)
    rest = _equilibrium(_scene(surface, a.point.x), nearest)
    length = max(float(np.linalg.norm(b.point.x - a.point.x)), _OFF * small)
    if rest is None or min(np.linalg.norm(y - rest) for y in (here, there)) > length:
        return None
    point = min((a, b), key=lambda m: np.linalg.norm(_start(surface, m.point.x)[0] - rest)).point
    for left in range(_TIMES, 0, -1):
        rest = _equilibrium(_scene(surface, point.x), rest)
        if rest is None:
            return None
        unknowns = equations.unpack(point.x)
        radius = equations.start_at(point.x) - rest
        between = np.asarray(unknowns.between)
        goal = _SMALL * (1 + float(np.linalg.norm(rest)))
        factor = min(1.0, (goal / float(np.linalg.norm(radius))) ** (1 / left))
        smaller = equations.pack(
            rest + factor * radius,
            rest + factor * (between - rest),
            *(float(x) for x in (unknowns.angle, unknowns.parameter, unknowns.period)),
        )
        across = equations.pack(radius, 0.0 * between, 0.0, 0.0, 0.0)
        found = surface.nearest(smaller, across=across / np.linalg.norm(across))
        if found is None or np.linalg.norm(found.x - point.x) > 2 * length:
            return None
        point = found
    member = member_at(surface, point, a.tangent, a.alike)
    return dataclasses.replace(member, kind=Kind.REST) if member.stability.ok else None


def _scene(surface: Surface, x: np.ndarray) -> Scene:
    return surface.equations.scene_at(jnp.asarray(parameter_at(surface, x)))


def _start(surface: Surface, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k,) the start at x and the flow there."""
    y = surface.equations.start_at(x)
    return y, np.asarray(_linearised(_scene(surface, x), y)[0])


def _equilibrium(scene: Scene, y: np.ndarray) -> np.ndarray | None:
    """(k,) the equilibrium nearest to a state; None if Newton's method does not converge."""
    for _ in range(_NEWTON_STEPS):
        flow, slope = map(np.asarray, _linearised(scene, y))
        if not np.isfinite(slope).all():
            return None
        step = np.linalg.lstsq(slope, -flow, rcond=_RANK)[0]
        y = y + step
        if np.linalg.norm(step) <= _SOLVED * (1 + np.linalg.norm(y)):
            return y
    return None


@jax.jit
def _linearised(scene: Scene, y):
    """The flow (k,) at a state, and its derivative (k, k)."""
    rate = lambda y: scene.rate(jnp.zeros(()), y)  # noqa: E731
    return rate(y), jax.jacfwd(rate)(y)
