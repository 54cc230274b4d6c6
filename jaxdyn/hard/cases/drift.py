"""Constraints over an hour: with projection, with Baumgarte's method, without correction.

The energy may change by the tolerance in each step, and projection must not add to that. The same
motion in coordinates without constraints is reported for comparison.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp

from jaxdyn.analysis import energy
from jaxdyn.hard.case import Case, Figure
from jaxdyn.integrate.simulation import simulate
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.scenes.linkages import dumbbell, four_bar
from jaxdyn.scenes.pendula import pendulum, triple_pendulum

_HOUR = 3600.0
_RTOL = 1e-6
_SAMPLES = 3601


def violation(motion: Trajectory) -> float:
    """The largest violation of the constraints along a motion, in position and in velocity."""
    phi, rates = jax.vmap(motion.scene.system.violation)(motion.ts, motion.ys)
    return float(jnp.maximum(jnp.max(jnp.abs(phi)), jnp.max(jnp.abs(rates))))


def _drift(make: Callable[..., Scene]) -> tuple[Figure, ...]:
    def hour(**kind) -> Trajectory:
        return simulate(make(**kind), _HOUR, samples=_SAMPLES, rtol=_RTOL, throw=False)

    projected, pulled, raw = (
        hour(formulation="constrained", drift=drift) for drift in ("projection", "baumgarte", "raw")
    )
    free = hour(formulation="newton_euler")
    drifted = float(energy.drift(projected))
    return (
        Figure("violation, projection", violation(projected), 1e-12),
        Figure("violation, Baumgarte", violation(pulled)),
        Figure("violation, raw", violation(raw)),
        Figure("energy a step, projection", drifted / int(projected.steps), _RTOL),
        Figure("energy, projection", drifted),
        Figure("energy, Baumgarte", float(energy.drift(pulled))),
        Figure("energy, raw", float(energy.drift(raw))),
        Figure("energy, without constraints", float(energy.drift(free))),
        Figure("steps, projection", int(projected.steps)),
    )


CASES = (
    Case(
        "drift-pendulum",
        "The constraints of a pendulum hold for an hour at rtol 1e-6.",
        functools.partial(_drift, pendulum),
    ),
    Case(
        "drift-dumbbell",
        "The constraints of a dumbbell hold for an hour at rtol 1e-6.",
        functools.partial(_drift, dumbbell),
    ),
    Case(
        "drift-four-bar",
        "The constraints of a four-bar linkage hold for an hour at rtol 1e-6.",
        functools.partial(_drift, four_bar),
    ),
    Case(
        "drift-triple-pendulum",
        "The constraints of a triple pendulum hold for an hour at rtol 1e-6.",
        functools.partial(_drift, triple_pendulum),
    ),
)
