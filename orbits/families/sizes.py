"""The units of lengths and angles along a family: the sizes of its orbits, and of its parameter.

A start says little about sizes near an equilibrium or a passage through zero, and along a family
starts move across the flow and may come there. So the size of an entry is its largest value along
the motion, and without a unit at least the effect of the other entries on it
(`orbits.closing.sizes.coupled_sizes`). The size of a parameter does not follow from its value,
which may be any number, but from its effect: one unit changes the rate, or the rate's derivatives,
by one of their units in a radian of the period, where the effect is largest. The effect is taken to
second order, since a parameter that enters by its square changes nothing to first order at 0.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from orbits.closing.sizes import sizes_along
from orbits.motion import sample
from orbits.shooting.equations import Equations, UnknownSizes, pieces, sizes_at
from orbits.shooting.segment import Make, scene_of


def unknown_sizes(
    equations: Equations, x: np.ndarray, least: np.ndarray | float = 0.0
) -> UnknownSizes:
    """The units at x (n,), with sizes (k,) of at least `least`."""
    unknowns = equations.unpack(x)
    ts, ys = _states(equations, x)
    scene = equations.scene_at(unknowns.parameter)
    scene = scene.starting(ys[0], float(unknowns.period))
    entry_sizes = np.maximum(sizes_along(scene, ys, sizes_at(equations, x)), least)
    make, parameter = equations.make, unknowns.parameter
    if make is None:
        return UnknownSizes(entry_sizes, 1.0)
    return UnknownSizes(
        entry_sizes, float(parameter_units(scene, make, parameter, ts, ys, entry_sizes)[0])
    )


def parameter_units(
    scene: Scene,
    make: Make,
    parameters: Array,
    ts: np.ndarray,
    ys: np.ndarray,
    entry_sizes: np.ndarray,
) -> np.ndarray:
    """(p,) the units of the parameters, () or (p,), of `make` along a motion (s, k).

    The scene's span is a period; the entries of its state have sizes `entry_sizes` (k,).
    """
    changes = np.asarray(_changes(scene, parameters, ts, ys, entry_sizes, make=make))
    first, second = changes * float(scene.t1) / (2 * np.pi)
    # first u + second u^2 / 2 = 1
    most = (first + np.sqrt(first**2 + 2 * second)) / 2
    return 1 / np.where((0 < most) & (most < np.inf), most, 1.0)


def _states(equations: Equations, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(s,) times and (s, k) states of the motion at x."""
    here = jax.tree.map(np.asarray, pieces(equations, x))
    if equations.segments > 1:
        return here.t0, here.start
    scene = equations.scene_at(equations.unpack(x).parameter).starting(here.start[0])
    return sample(scene, here.span[0])


@functools.partial(jax.jit, static_argnames="make")
def _changes(
    scene: Scene, parameters, ts: Array, ys: Array, entry_sizes: Array, *, make: Make
) -> Array:
    """(2, p) largest changes of the rate, or of its derivatives, with the parameters, in sizes.

    The first row is to first order; the second one is of the rate alone, to second order.
    """

    def largest(t, y):
        def rate(y, values):
            return scene_of(scene, make, values).rate(t, y)

        def slopes(y):
            return jax.jacfwd(rate, argnums=1)(y, parameters).reshape(len(y), -1)

        def curvature(direction):
            def slope(values):
                return jax.jvp(lambda values: rate(y, values), (values,), (direction,))[1]

            return jax.jvp(slope, (parameters,), (direction,))[1]

        by_y = jax.jacfwd(slopes)(y) * entry_sizes[None, None]
        firsts = jnp.concatenate([slopes(y)[..., None], by_y], axis=2)
        axes = jnp.eye(parameters.size).reshape(-1, *parameters.shape)
        seconds = jax.vmap(curvature, out_axes=1)(axes)[..., None]
        both = [jnp.abs(found) / entry_sizes[:, None, None] for found in (firsts, seconds)]
        return jnp.stack([jnp.where(jnp.isfinite(x), x, 0.0).max(axis=(0, 2)) for x in both])

    return jnp.max(jax.vmap(largest)(ts, ys), axis=0)
