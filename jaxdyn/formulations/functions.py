"""Functions that a user writes as parts of a scene: how they are checked and called.

A function is static: it belongs to the compiled program, which is used again as long as the same
function is given. The numbers it depends on are passed to it as its last argument, `params`, so
that new ones do not compile again and derivatives go through them.
"""

import reprlib
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import refuse_narrow
from jaxdyn._records import PASS_AS_PARAMS


class WithFunctions(eqx.Module):
    """Parameters some of whose leaves are functions, not numbers, as in a network.

    Attributes:
      numbers: the same pytree, with None in place of functions; its leaves can be traced.
      rest: the same pytree, with None in place of numbers; part of the compiled program.
    """

    numbers: Any
    rest: Any = eqx.field(static=True)


def call(function: Callable, params: Any, *args: Array) -> Any:
    """The value of the function for these arguments and, where there are any, the parameters."""
    if isinstance(params, WithFunctions):
        params = eqx.combine(params.numbers, params.rest)
    return function(*args) if params is None else function(*args, params)


def check_function(name: str, function: Any, params: Any, *args: str) -> Callable:
    """The function, if it can be called with these arguments and be part of a program."""
    given = args if params is None else (*args, "params")
    remedy = "It gets `params` as its last argument if and only if params=... is given."
    _checks.check_callable(name, function, *given, remedy=remedy)
    try:
        hash(function)
    except TypeError as error:
        raise _checks.fail(name, "a hashable function", repr(function), PASS_AS_PARAMS) from error
    return function


def as_params(params: Any) -> Any:
    """The parameters with numbers as float arrays; None for none."""
    remedy = (
        "A pytree of numbers: a number, a tuple, a dictionary, a module of arrays. Texts and flags "
        "may be static fields of an eqx.Module, and the function may capture keys of jax.random."
    )
    numbers, rest = eqx.partition(params, lambda x: not callable(x))
    if jax.tree.leaves(rest) and jax.tree.leaves(numbers):
        return WithFunctions(as_params(numbers), rest)
    if params is not None and not jax.tree.leaves(params):
        raise _checks.fail("params", "numbers", f"none in {params!r}", "Leave it out.")
    return jax.tree.map(lambda x: _checks.numbers("params", x, remedy), params)


def finite_params(params: Any) -> None:
    """Raise ValueError unless all parameters that are not traced are finite."""
    for leaf in jax.tree.leaves(params):
        _checks.finite("params", leaf)


def vector(name: str, value: Any, like: Array) -> Array:
    """The value of a function, perhaps a list of numbers, as floats of the type of `like`."""
    if value is None:
        raise _checks.fail(name, "an array or a list of numbers", "None", "Does it `return` them?")

    for x in jax.tree.leaves(value):
        refuse_narrow(x, name)

    def converted(x: Any) -> Any:
        # Complex numbers stay, to be refused: a conversion would drop their imaginary parts.
        return x if jnp.iscomplexobj(x) else jnp.asarray(x, like.dtype)

    try:
        if isinstance(value, list | tuple):
            value = jnp.stack([jnp.asarray(converted(x)) for x in value])
        return converted(value)
    except (TypeError, ValueError) as error:
        got = reprlib.repr(value)
        raise _checks.fail(name, "an array or a list of numbers", got) from error


def name_entries(
    names: Sequence[str | tuple[str, str]] | None, letter: str, count: int
) -> tuple[tuple[str, str], ...]:
    """(name, unit) of each entry, "1" where no unit is given; y0, y1, ... if left out."""
    if not count:
        raise _checks.fail(f"{letter}0", "at least one entry", "none")
    if names is None:
        return tuple((f"{letter}{i}", "1") for i in range(count))
    remedy = f"One name or (name, unit) for each of the {count} entries."
    if isinstance(names, str) or not isinstance(names, Sequence):
        raise _checks.fail("names", "a list", repr(names), remedy)
    if len(names) != count:
        raise _checks.fail("names", f"{count}", len(names), remedy)
    pairs = tuple(_with_unit(x) for x in names)
    if len({name for name, _ in pairs}) < count:
        raise _checks.fail("names", "different ones", [name for name, _ in pairs])
    return pairs


def _with_unit(given: Any) -> tuple[str, str]:
    match (given, "1") if isinstance(given, str) else given:
        case (str(name), str(unit)) if name and unit:
            return name, unit
    raise _checks.fail("names", "a name or a pair (name, unit)", repr(given))
