"""A scene of the catalogue as a function of one of its numbers, for families."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import choice, fail
from jaxdyn.scenes import catalogue

_ASIDE, _LATER = 0.1, 0.3  # a state and a time where a drive or a damper acts, if any does


def maker(
    name: str, values: dict[str, Any], parameter: str
) -> tuple[Callable[[Array], Scene], float]:
    """The scene of the catalogue as a function of one of its numbers, and the present value.

    Args:
      name: name of the scene.
      values: the numbers that differ from the scene's defaults.
      parameter: name of the number.
    Raises:
      ValueError: the scene has no such number, or its rate is not differentiable in it.
    """
    entry = catalogue.entries()[name]
    choice("--parameter", parameter, entry.parameters)
    value = {**entry.parameters, **values}[parameter]
    remedy = "Its motion must be smooth in it."
    if isinstance(value, bool | str) or not isinstance(value, int | float):
        raise fail("--parameter", "one number", f"{parameter} = {value!r}", remedy)

    def make(x: Array) -> Scene:
        return entry.make(**{**values, parameter: x})

    try:
        slopes = jax.jacfwd(lambda x: _rates(make(x)))(float(value))
    except (jax.errors.JAXTypeError, TypeError) as error:
        got = f"{parameter}, which shapes the scene of {name}"
        raise fail("--parameter", "one that only changes numbers", got, remedy) from error
    if not np.any(slopes):
        remedy = "The start is found anyway; without --parameter the energy changes."
        raise fail("--parameter", "one that changes the forces", parameter, remedy)
    return make, float(value)


def _rates(scene: Scene) -> Array:
    """(2, k) rates of the scene at its start, and at a nearby state at a later time."""
    y0 = jax.lax.stop_gradient(scene.y0)
    aside = scene.system.project(_LATER, y0 + _ASIDE)
    return jnp.stack([scene.rate(jnp.zeros(()), y0), scene.rate(_LATER, aside)])
