"""A scene of the catalogue as a function of one of its numbers, for families."""

import inspect
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import check_first, choice, fail
from jaxdyn.scenes import catalogue
from jaxdyn.scenes.corners import has_corners

_ASIDE, _LATER = 0.1, 0.3  # offset of a state, and a time, where a drive or damper acts, if any


@check_first
def maker(
    name: str, values: dict[str, Any], parameter: str
) -> tuple[Callable[[Array], Scene], float]:
    """The scene of the catalogue as a function of one of its numbers, and the present value.

    Args:
      name: name of the scene.
      values: the numbers that differ from the scene's defaults.
      parameter: name of the number; ``m.0`` is the first entry of a parameter m.
    Raises:
      ValueError: the scene has no such number, or its rate has no derivative with respect to it.
    """
    entry = catalogue.entry(name)
    whole, _, place = parameter.partition(".")
    choice("parameter", whole, entry.parameters)
    value, remedy = {**entry.parameters, **values}[whole], "Its motion must be smooth in it."
    if not isinstance(value, bool | str) and np.ndim(value) == 1:
        names = [f"{whole}.{i}" for i in range(len(value))]
        if parameter not in names:
            raise fail("parameter", f"one of {', '.join(names)}", parameter)
        value = np.asarray(value, float).tolist()[int(place)]
    elif place or isinstance(value, bool | str) or not isinstance(value, int | float):
        raise fail("parameter", "one number", f"{parameter} = {value!r}", remedy)

    def make(x: Array) -> Scene:
        return entry.make(**_with_number(entry, values, parameter, x))

    try:
        slopes = jax.jacfwd(lambda x: _rates(make(x)))(float(value))
    except (jax.errors.JAXTypeError, TypeError) as error:
        got = f"{parameter}, which shapes the scene of {name}"
        raise fail("parameter", "one that only changes numbers", got, remedy) from error
    if not np.any(slopes):
        got, remedy = (
            f"{parameter}, which changes the start alone",
            "Without one, the energy varies.",
        )
        if has_corners(make(jnp.asarray(value, float))):
            remedy = "The guide 22_walkers.md has periodic motions with impacts, by find_hybrid."
        raise fail("parameter", "one that changes the rate of the state", got, remedy)
    return make, float(value)


def _with_number(
    entry: catalogue.Entry, values: dict[str, Any], parameter: str, x: Array
) -> dict[str, Any]:
    """The values with another number for a parameter, or for an entry of one."""
    whole, _, place = parameter.partition(".")
    if not place:
        return {**values, whole: x}
    known = jnp.asarray({**entry.parameters, **values}[whole], float)
    return {**values, whole: known.at[int(place)].set(x)}


def maker_of_two(
    name: str, values: dict[str, Any], parameters: tuple[str, str]
) -> tuple[Callable[[Array, Array], Scene], tuple[float, float]]:
    """The scene as a function of two of its numbers, with their names as those of its arguments.

    Args:
      name: name of the scene.
      values: the numbers that differ from the scene's defaults.
      parameters: names of the two numbers.
    Raises:
      ValueError: both are the same, or `maker` refuses one of them.
    """
    first, second = parameters
    if first == second:
        raise fail("parameters", "two different numbers", f"{first} twice")
    present = tuple(maker(name, values, parameter)[1] for parameter in parameters)
    entry = catalogue.entry(name)

    def make(x: Array, y: Array) -> Scene:
        return entry.make(**_with_number(entry, _with_number(entry, values, first, x), second, y))

    kind = inspect.Parameter.POSITIONAL_ONLY
    named = [inspect.Parameter(parameter.replace(".", ""), kind) for parameter in parameters]
    make.__signature__ = inspect.Signature(named)  # pyright: ignore[reportFunctionMemberAccess]
    return make, (present[0], present[1])


def _rates(scene: Scene) -> Array:
    """(2, k) rates of the scene at its start, and at a nearby state at a later time."""
    y0 = jax.lax.stop_gradient(scene.y0)
    aside = scene.system.project(_LATER, y0 + _ASIDE * jnp.arange(1.0, len(y0) + 1))
    return jnp.stack([scene.rate(jnp.zeros(()), y0), scene.rate(_LATER, aside)])
