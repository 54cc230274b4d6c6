"""The parameters of a scene: its numbers one by one, with names, for formulas and for players.

A parameter is a number of the system or of an effect; the initial state and the span are not
parameters. Its name is the shortest end of its path that no other parameter shares, with array
indices in brackets, from 0: `g`, `m[1]`, `r[2,0]`, `effects[0].k` if two effects have a `k`. A
system may name the entries of its arrays (`System.parameter_names`).
"""

import dataclasses
import re
from collections import Counter
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._text import meaning_of, unit_of
from jaxdyn.scene import Field, Scene


class Parameters(NamedTuple):
    """The parameters of a scene.

    Attributes:
      names: (n) names.
      values: (n,) values.
    """

    names: tuple[str, ...]
    values: np.ndarray


class Leaf(NamedTuple):
    """An array of parameters: the parts of its path, its values, and the index of the first.

    Attributes:
      path: names of attributes, keys and indices, from the field on.
      value: the array.
      start: number of parameters before it.
      is_fixed: whether it is a default value of a class that no scene sets, such as the side of a
        line.
    """

    path: tuple[str, ...]
    value: np.ndarray
    start: int
    is_fixed: bool


def parameters(scene: Scene) -> Parameters:
    """The names and values of all parameters of a scene, in the order of its fields.

    Raises:
      ValueError: the scene is invalid, or its numbers are traced.
    Example:
      >>> from jaxdyn import scenes
      >>> from jaxdyn.symbolic.parameters import parameters
      >>> found = parameters(scenes.cart_pendulum())
      >>> dict(zip(found.names, found.values.tolist()))
      {'m[0]': 1.0, 'm[1]': 1.0, 'l': 1.0, 'g': 9.81}
    """
    found = leaves(scene.field)
    names = [
        name for leaf, stem in zip(found, _stems(found), strict=True) for name in _names(leaf, stem)
    ]
    values = [leaf.value.ravel() for leaf in found]
    return Parameters(tuple(names), np.concatenate([np.zeros(0), *values]))


def with_parameters(scene: Scene, values: Array) -> Scene:
    """The same scene with other values (n,) of its `parameters`, which may be traced."""
    values = jnp.asarray(values, float)
    _checks.check_shape("values", values.shape, parameters(scene).values.shape, "One for each.")
    system, effects = rebuild(scene.field, values)
    return dataclasses.replace(scene, system=system, effects=effects)


class Description(NamedTuple):
    """What the docstring of its class says about a parameter: its unit, and what it is."""

    unit: str
    meaning: str


def descriptions(scene: Scene, leaf: Leaf) -> list[Description]:
    """What is known of each entry of an array of parameters; "" where nothing is.

    The unit is that in the units of the scene.

    Example:
      >>> from jaxdyn import scenes
      >>> scene = scenes.cart_pendulum()
      >>> [one.meaning for one in descriptions(scene, leaves(scene.field)[0])]
      ['mass of the cart', 'mass of the point']
    """
    if "params" in leaf.path:  # those of a user's function have no docstring
        return [Description("", "")] * leaf.value.size
    owner: Any = scene.field
    unit = meaning = ""
    for part in leaf.path:
        if eqx.is_array(owner):  # one of its entries, by a name
            break
        if part.startswith("["):
            owner = owner[int(part[1:-1])]
        elif isinstance(owner, dict):
            owner = owner[part]
        else:
            unit, meaning = unit_of(type(owner), part), meaning_of(type(owner), part)
            owner = getattr(owner, part)
    one = _PLURAL.sub(lambda found: _ONE_OF[found[0]], meaning, count=1)
    unit = "" if unit == "1" else scene.in_units(unit)
    return [Description(unit, each) for each in _of_each(one, leaf.value.size)]


def _of_each(meaning: str, n: int) -> list[str]:
    """The meaning of each of n entries: "mass of A and of B" is that of two, in this order."""
    first, *others = _OWNERS.split(meaning)
    if len(others) + 1 != n:
        return [meaning] * n
    what = first.partition(" of ")[0]
    return [first, *(f"{what} {of}" for of in others)]


#: What is between the owners of the entries of an array, as in "mass of A, of B and of C".
_OWNERS = re.compile(r"(?:,| and) (?=of )")


#: What one entry of an array is called.
_ONE_OF = {
    "masses": "mass",
    "lengths": "length",
    "stiffnesses": "stiffness",
    "positions": "position",
    "directions": "direction",
}
_PLURAL = re.compile(rf"\b({'|'.join(_ONE_OF)})\b")


def rebuild(field: Field, values: Array) -> Field:
    """A field with its parameters replaced by values (n,)."""
    numbers, tree = jax.tree.flatten(field)
    start, made = 0, []
    for x in numbers:
        if _is_parameter(x):
            size = int(np.size(x))
            made.append(values[start : start + size].reshape(np.shape(x)))
            start += size
        else:
            made.append(x)
    return jax.tree.unflatten(tree, made)


def leaves(field: Field) -> list[Leaf]:
    """The arrays of a field whose entries are its parameters."""
    found, start = [], 0
    for path, x in jax.tree_util.tree_flatten_with_path(field)[0]:
        if not _is_parameter(x):
            continue
        if _checks.is_traced(x):
            remedy = "Call it outside jit, grad and vmap."
            raise _checks.fail("scene", "one whose numbers are known", "traced ones", remedy)
        value, at = np.asarray(x, float), tuple(map(_part, path))
        for name, part in _named_parts(field, at, value):
            found.append(Leaf((*at, *name), part, start, isinstance(x, float)))
            start += part.size
    return found


def _named_parts(
    field: Field, path: tuple[str, ...], value: np.ndarray
) -> list[tuple[tuple[str, ...], np.ndarray]]:
    """An array as a whole, without a name, or its entries by the names that the system has."""
    of, *rest = path
    while rest[:1] == ["system"]:  # an extended system, which has the same names
        del rest[0]
    names = field.system.parameter_names().get(rest[0]) if of == "system" and rest else None
    if names is None:
        return [((), value)]
    return [
        ((name,), np.asarray(entry)) for name, entry in zip(names, np.ravel(value), strict=True)
    ]


def _is_parameter(x: Any) -> bool:
    return isinstance(x, float) or jnp.issubdtype(jnp.result_type(x), jnp.floating)


def _part(key: Any) -> str:
    """A part of a path: a name, or an index in brackets."""
    name = getattr(key, "name", getattr(key, "key", None))
    return f"[{getattr(key, 'idx', name)}]" if not isinstance(name, str) else name


def _stems(found: list[Leaf]) -> list[str]:
    """For each array, the shortest end of its path that no other array shares."""
    ends = [[_join(leaf.path[i:]) for i in reversed(_beginnings(leaf.path))] for leaf in found]
    counts = Counter(end for mine in ends for end in set(mine))
    return [next((end for end in mine if counts[end] == 1), mine[-1]) for mine in ends]


def _beginnings(path: tuple[str, ...]) -> list[int]:
    """Where an end of a path may begin: at a name."""
    return [i for i, part in enumerate(path) if not part.startswith("[")] or [0]


def _join(path: tuple[str, ...]) -> str:
    return "".join(part if part.startswith("[") else f".{part}" for part in path).lstrip(".")


def _names(leaf: Leaf, stem: str) -> list[str]:
    if not leaf.value.ndim:
        return [stem]
    places = (",".join(map(str, at)) for at in np.ndindex(leaf.value.shape))
    return [f"{stem}[{place}]" for place in places]
