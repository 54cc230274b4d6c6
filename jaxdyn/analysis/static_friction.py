"""Rates and forces of the motion that continues from a state, also where friction holds a body.

There the state is on a surface where the friction jumps, and the formula of the rate has the force
of either side, or of neither: the law of dry friction says nothing at a speed of zero.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn.formulations.extended import Extended
from jaxdyn.integrate.flow import rate_in
from jaxdyn.integrate.simulation import branch_from
from jaxdyn.integrate.spans import RTOL
from jaxdyn.plan import plan_of
from jaxdyn.scene import Field, Scene

#: A function (field, t, y) -> (m,), such as the forces of effects; a named function.
Values = Callable[[Field, Array, Array], Array]


class _Beside(Extended):
    """A system with further state entries, whose rates are the given values.

    So where a motion slides on a surface, the values of its two sides are weighted as the rates.
    """

    values: Values = eqx.field(static=True)

    def further(self):
        return ()

    def rate(self, t, y, effects):
        inner, field = self.parts(y)[0], Field(self.system, effects)
        return jnp.concatenate([field.rate(t, inner), self.values(field, t, inner)])


def with_static_friction(
    scene: Scene, values: Values, t: Array, y: Array, t1: Array
) -> Callable[[Array, Array], tuple[Array, Array]]:
    """The function (t, y) -> the rate (k,) and values (m,), of the motion that continues from y.

    Args:
      scene: system and effects; its start is not used.
      values: the function (field, t, y) -> (m,).
      t: () time.
      y: (k,) state at t.
      t1: () a time beyond the end of the motion.
    """
    field, k = scene.field, len(y)
    if not plan_of(field, k).most_surfaces:
        return lambda t, y: (field.rate(t, y), values(field, t, y))
    none = jnp.zeros_like(values(field, t, y))
    whole = dataclasses.replace(
        scene, system=_Beside(scene.system, values), y0=jnp.append(scene.y0, none)
    )
    branch = branch_from(whole, t, jnp.append(y, none), t1, rtol=RTOL)

    def both(t: Array, y: Array) -> tuple[Array, Array]:
        rates = rate_in(branch, whole.field, t, jnp.append(y, none))
        return rates[:k], rates[k:]

    return both
