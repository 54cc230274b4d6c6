"""Whether equal bodies of an orbit follow one curve at equal times apart: a choreography."""

import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene
from jaxdyn._progress import doing
from jaxdyn.balls.arithmetic import arb, precision
from jaxdyn.balls.tube import NotEnclosed, tube
from jaxdyn.formulations.newton import FreePoints
from orbits.closing.closings import choreography
from orbits.proof.closing_equations import ClosingEquations
from orbits.proof.posing import table

_DIGITS = 30.0  # of where bodies are within a period


def on_one_curve(
    scene: Scene, system: ClosingEquations, numbers: list[arb], bits: int
) -> bool | None:
    """Whether equal bodies follow one curve at equal times apart; None if not proved, or not asked.

    On such a curve, after the n-th part of any period each body is where one of them was at first,
    in whichever order they follow.
    """
    points = scene.points(jnp.zeros(()), scene.y0) if scene.has_points else None
    other = system.drive is not None or system.reversals is not None
    if points is None or other or not isinstance(scene.system, FreePoints):
        return None
    n, d = points.r.shape
    if n < 2 or 2 * n * d != len(scene.y0) or not np.array_equal(points.m, points.m[:1].repeat(n)):
        return None
    if system.generator is not None:
        return None
    tables = [table(one.symmetry, np.eye(len(scene.y0), dtype=int)) for one in choreography(n, d)]
    if any(np.array_equal(system.goal, one) for one in tables):
        return True
    if system.parts != 1:
        return None
    doing("enclosing where the bodies are after a part of the period")
    try:
        first, *_ = _bodies(_after_part(system, numbers, n, bits), n)
    except NotEnclosed:
        return None
    with precision(bits):
        bodies = _bodies(system.start(numbers), n)
    apart = all(any(not a.overlaps(b) for a, b in zip(first, x, strict=True)) for x in bodies)
    return False if apart else None


def _after_part(system: ClosingEquations, numbers: list[arb], n: int, bits: int) -> list[arb]:
    """(k) the state after the n-th part of the period."""
    with precision(bits):
        starts, period = system.start(numbers), system.period(numbers) / n
        at = system.field, arb(0), [x.mid() for x in starts], starts
        span = period.mid(), period
        return tube(*at, span, _DIGITS, bits, sizes=system.sizes).box


def _bodies(state: list[arb], n: int) -> list[list[arb]]:
    """Position and velocity of each of n bodies, from a state [r, v]."""
    d = len(state) // (2 * n)
    at = [state[i : i + d] for i in range(0, len(state), d)]
    return [at[i] + at[n + i] for i in range(n)]
