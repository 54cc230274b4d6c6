"""Constraints that are nearly dependent, redundant, or dependent in a single pose.

Two skates with slightly different headings turn the body about the point where their normals meet.
Redundant rods change nothing. At a dead centre a linkage may continue in two ways, and is refused.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn.analysis import constraints
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.hard.case import Case, Figure, absolute_error
from jaxdyn.integrate.simulation import solve
from jaxdyn.mechanisms.bars import Chain
from jaxdyn.mechanisms.rods import Rods
from jaxdyn.mechanisms.skates import Skated
from jaxdyn.scene import Scene
from jaxdyn.status import Status

_RTOL, _LOOSER = 1e-13, 1e-11
_SKATES = np.array([[0.2, 0.0], [0.2, 1.5]])
_TURNING = 0.8  # [rad/s]
_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2))  # as many rods as make four points rigid


def body_on_skates(between: float) -> Scene:
    """A body on two skates, one above the other, with an angle between their headings [rad].

    Their normals meet at the upper skate, about which the body turns at a constant rate.
    """
    body = Skated(m=1.0, inertia=0.5, at=jnp.asarray(_SKATES), headings=jnp.array([0.0, between]))
    x, y = _SKATES[1]
    return Scene(Constrained(body), y0=[0, 0, 0, _TURNING * y, -_TURNING * x, _TURNING], t1=2.0)


def _skates() -> tuple[Figure, ...]:
    t1, figures = 2.0, []
    turned = _TURNING * t1
    c, s = math.cos(turned), math.sin(turned)
    (x, y) = _SKATES[1]
    wanted = np.array([x - c * x + s * y, y - s * x - c * y, turned])
    for between, followed in ((1e-2, True), (1e-4, True), (1e-6, False)):
        scene = body_on_skates(between)
        end = solve(scene, t1, rtol=_LOOSER, max_steps=100_000)
        gap = absolute_error(end.y1[:3], wanted)
        report = constraints.conditioning(scene, 0.0, scene.y0)
        # Forces lose twice the digits of the condition number; at 1e6 the run must be refused or
        # the result be correct nevertheless.
        refused = int(end.status) != Status.OK and math.isnan(gap)
        place = 0.0 if refused and not followed else gap
        figures += [
            Figure(f"{between:g} rad apart: place, if given [m]", place, 1e-9),
            Figure(f"{between:g} rad apart: status", int(end.status)),
            Figure(f"{between:g} rad apart: condition", float(report.condition)),
            Figure(f"{between:g} rad apart: not seen as two", float(report.rank != 2), 0),
        ]
    return tuple(figures)


def frame(pairs: tuple[tuple[int, int], ...]) -> Scene:
    """Four points at the corners of a square, joined by rods, turning and thrown."""
    ends = np.array(pairs)
    length = np.linalg.norm(_SQUARE[ends[:, 0]] - _SQUARE[ends[:, 1]], axis=1)
    v = 2.0 * np.stack([0.5 - _SQUARE[:, 1], _SQUARE[:, 0] - 0.3], axis=1)
    system = Constrained(Rods(jnp.array([1.0, 2.0, 0.5, 3.0]), jnp.asarray(length), pairs))
    return Scene(system, (UniformGravity(3.0),), y0=np.concatenate([_SQUARE.ravel(), v.ravel()]))


def _rods() -> tuple[Figure, ...]:
    plain, doubled = frame(_SIDES), frame((*_SIDES, (1, 3), (0, 1)))
    ends = [solve(scene, 2.0, rtol=_RTOL).y1 for scene in (plain, doubled)]
    report = constraints.conditioning(doubled, 0.0, doubled.y0)
    return (
        Figure("apart from the frame without them [m]", absolute_error(*ends), 1e-9),
        Figure("redundant rods not counted", abs(int(report.redundant) - 2), 0),
        Figure("condition of the others", float(report.condition)),
    )


def folding_bars(short_of: float, rate: float = 0.0) -> Scene:
    """Bars of lengths 1, 2, 1 on hinges 2 apart, short of the flat pose by an angle [rad].

    As a parallelogram they turn towards the flat pose at a rate [rad/s].
    """
    chain = Chain(jnp.ones(3), jnp.array([1.0, 2.0, 1.0]), jnp.array([2.0, 0.0]))
    angle = math.pi / 2 - short_of
    start = [angle, math.pi / 2, angle - math.pi, rate, 0.0, rate]
    return Scene(Constrained(chain), (UniformGravity(1.0),), y0=start)


def _dead() -> tuple[Figure, ...]:
    flat = folding_bars(0.0)
    end = solve(flat, 1.0)
    # Rough steps could jump over the flat pose; fine ones lose all digits beside it.
    through = [solve(folding_bars(0.3, 2.0), 1.0, rtol=rtol) for rtol in (1e-5, 1e-10)]
    passed = sum(int(end.status) != Status.SINGULAR for end in through)
    near = np.array([1e-1, 1e-3, 1e-5])
    starts = jnp.stack([folding_bars(short).y0 for short in near])
    found = jax.vmap(lambda y: constraints.conditioning(flat, 0.0, y))(starts)
    grows = np.asarray(found.condition) * near
    at_rest = constraints.conditioning(flat, 0.0, flat.y0)
    return (
        Figure("motion out of the flat pose not refused", float(end.status != Status.SINGULAR), 0),
        Figure("numbers from it", float(np.isfinite(np.asarray(end.y1)).sum()), 0),
        Figure("motions through it not refused", float(passed), 0),
        Figure("flat pose seen as determined", float(at_rest.determined), 0),
        Figure("condition against 1 / angle", float(np.abs(grows / grows[-1] - 1).max()), 0.1),
        Figure("condition 1e-5 rad beside it", float(found.condition[-1])),
    )


CASES = (
    Case("skates-nearly-parallel", "Two skates with nearly the same normal turn a body.", _skates),
    Case("redundant-rods", "Redundant rods change nothing, and are counted.", _rods),
    Case(
        "dead-centre",
        "A linkage at a dead centre is refused; close to it there is a warning.",
        _dead,
    ),
)
