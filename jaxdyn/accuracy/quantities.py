"""Quantities to compare solvers: end state, energy drift, constraints, a gradient, an event."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.analysis import energy
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.integrate.events import Event, until
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Scene
from jaxdyn.solvers import Method

_SAMPLES = 17  # at which drift and violation are evaluated


class Quantity(NamedTuple):
    """A quantity whose error is measured.

    Attributes:
      name: its name in tables.
      of: (scene, t1, *, solver, rtol, dt) -> array, where the keywords are those of `solve`: a
        solver with a tolerance gets no dt, one of fixed step has no use for rtol.
      exact: its exact value, if known; else a fine solution is the reference.
    """

    name: str
    of: Callable[..., Array]
    exact: float | None = None


def _end(scene: Scene, t1: Array, *, solver: Method, rtol: Any, dt: Any) -> Array:
    return solve(scene, t1, solver=solver, rtol=rtol, dt=dt).y1


def _drift(scene: Scene, t1: Array, *, solver: Method, rtol: Any, dt: Any) -> Array:
    ts = jnp.linspace(0.0, t1, _SAMPLES)
    ys = solve(scene, t1, ts=ts, solver=solver, rtol=rtol, dt=dt).ys
    return energy.change(scene, ts, ys).relative


def _violation(scene: Scene, t1: Array, *, solver: Method, rtol: Any, dt: Any) -> Array:
    if not isinstance(scene.system, Constrained):
        name = type(scene.system).__name__
        raise _checks.fail("scene", "one with constraints", name, 'Try formulation="constrained".')
    ts = jnp.linspace(0.0, t1, _SAMPLES)
    ys = solve(scene, t1, ts=ts, solver=solver, rtol=rtol, dt=dt).ys
    place, _ = jax.vmap(scene.system.violation)(ts, ys)
    return jnp.max(jnp.abs(place))


def _gradient(scene: Scene, t1: Array, *, solver: Method, rtol: Any, dt: Any) -> Array:
    def loss(y0):
        y1 = solve(scene.starting(y0), t1, solver=solver, rtol=rtol, dt=dt).y1
        return 0.5 * jnp.sum(y1 * y1)

    return jax.grad(loss)(scene.y0)


END = Quantity("end state", _end)
ENERGY_DRIFT = Quantity("energy drift", _drift, 0.0)
CONSTRAINTS = Quantity("constraint violation", _violation, 0.0)
#: The gradient of half the square of the end state, with respect to the start.
GRADIENT = Quantity("gradient", _gradient)


def event_time(event: Event) -> Quantity:
    """The time of an event within the span; for solvers with a tolerance."""

    def of(scene: Scene, t1: Array, *, solver: Method, rtol: Any, dt: Any) -> Array:
        del dt  # `until` refuses solvers of fixed step
        return until(scene, event, t1, solver=solver, rtol=rtol).t

    return Quantity("event time", of)
