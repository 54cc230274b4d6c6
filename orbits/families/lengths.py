"""The units of lengths and angles along a family: the sizes of its orbits, and of its parameter.

A start says little where it is near an equilibrium, or a passage through zero, as starts are that
move across the flow along a family. So an entry has its largest size along the motion; one without
a unit has at least the size that others give to it (`orbits.closing.sizes.coupled`). A parameter
has no size by its value, which may be anything, but by what it changes: its unit changes the rate,
or the rate's derivatives, by their units in a radian of the period, where it does so most.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status
from orbits.closing.sizes import alike, coupled
from orbits.motion import solved
from orbits.shooting.equations import Equations, pieces
from orbits.shooting.segment import Make, scene_of
from orbits.shooting.units import Lengths, sizes_at

_SAMPLES = 64  # of a motion in one segment
_SAMPLE_RTOL = 1e-6  # a size needs no more digits
_MAX_STEPS = 20_000  # for a motion that is not known to be an orbit


def lengths(equations: Equations, x: np.ndarray, least: np.ndarray | float = 0.0) -> Lengths:
    """The units at x (n,), with sizes (k,) of at least `least`."""
    unknowns = equations.unpack(x)
    ts, ys = _states(equations, x)
    scene = equations.scene_at(unknowns.parameter)
    scene = scene.starting(ys[0], float(unknowns.period))
    each = np.maximum(sizes_at(equations, x), alike(scene, np.abs(ys).max(axis=0)))
    each = np.maximum(coupled(scene, each), least)
    if equations.make is None:
        return Lengths(each, 1.0)
    changes = _changes(scene, unknowns.parameter, ts, ys, each, make=equations.make)
    most = float(changes) * float(unknowns.period) / (2 * np.pi)
    return Lengths(each, 1 / most if 0 < most < np.inf else 1.0)


def _states(equations: Equations, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(s,) times and (s, k) states of the motion at x."""
    here = jax.tree.map(np.asarray, pieces(equations, x))
    if equations.segments > 1:
        return here.t0, here.start
    scene = equations.scene_at(equations.unpack(x).parameter).starting(here.start[0])
    ts = np.linspace(0.0, here.span[0], _SAMPLES + 1)
    flow = solved(scene, ts[-1], ts=ts, rtol=_SAMPLE_RTOL, max_steps=_MAX_STEPS)
    if int(flow.status) != Status.OK:
        return here.t0, here.start
    return ts, np.asarray(flow.ys)


@functools.partial(jax.jit, static_argnames="make")
def _changes(scene: Scene, parameter, ts: Array, ys: Array, each: Array, *, make: Make) -> Array:
    """() the largest change by a parameter of the rate, or of its derivatives, in sizes (k,)."""

    def by_parameter(t, y):
        def rate(value):
            return scene_of(scene, make, value).rate(t, y)

        return jax.jvp(rate, (parameter,), (jnp.ones_like(parameter),))[1]

    def largest(t, y):
        by_both = jax.jacfwd(by_parameter, argnums=1)(t, y) * each[None]
        found = jnp.abs(jnp.column_stack([by_parameter(t, y), by_both])) / each[:, None]
        return jnp.max(jnp.where(jnp.isfinite(found), found, 0.0))

    return jnp.max(jax.vmap(largest)(ts, ys))
