"""The pytree that a flat state stands for, where a user's functions take and return one.

The state of a scene is one array (k,), whatever its parts mean. A `Structure` says which parts: it
is part of the program, as shapes are, and its leaves lie in the state in the order of `jax.tree`,
in which a dictionary is sorted by its keys.
"""

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.formulations.functions import vector


@dataclasses.dataclass(frozen=True)
class Structure:
    """A pytree of arrays that is stored as one array.

    Attributes:
      tree: how the leaves are arranged.
      shapes: shapes of the leaves.
    """

    tree: Any
    shapes: tuple[tuple[int, ...], ...]

    def tree_of(self, y: Array) -> Any:
        """The pytree that states (..., k) stand for, with leaves (..., *shape)."""
        sizes = [math.prod(shape) for shape in self.shapes]
        parts = jnp.split(y, np.cumsum(sizes)[:-1].tolist(), axis=-1)
        shaped = zip(parts, self.shapes, strict=True)
        leaves = [part.reshape(*y.shape[:-1], *shape) for part, shape in shaped]
        return jax.tree.unflatten(self.tree, leaves)

    def flatten(self, name: str, value: Any, like: Array) -> Array:
        """A pytree of this structure as an array (k,) of floats like another one.

        Raises:
          ValueError: it has another structure, or a leaf of another shape.
        """
        leaves, tree = jax.tree.flatten(value, is_leaf=_is_list)
        if tree != self.tree:
            wanted = f"a pytree like y0, {_printed(self.tree)}"
            raise _checks.fail(name, wanted, _printed(tree), "It has the parts of the state.")
        arrays = [vector(name, leaf, like) for leaf in leaves]
        for x, shape in zip(arrays, self.shapes, strict=True):
            _checks.check_shape(name, x.shape, shape, "That of the same part of y0.")
        return jnp.concatenate([x.ravel() for x in arrays])


def flatten_start(y0: Any, names: Any) -> tuple[Any, Any, Structure | None]:
    """The start as an array, names of its entries, its structure.

    Names are those given, or the keys that lead to an entry; what is an array or a list of numbers
    stays as it is, and has no structure.

    Raises:
      ValueError: a leaf of a pytree is not an array of finite numbers.
    """
    if not _is_tree(y0):
        return y0, names, None
    found, tree = jax.tree_util.tree_flatten_with_path(y0, is_leaf=_is_list)
    if not found:
        raise _checks.fail("y0", "at least one entry", repr(y0))
    named = [(_path(path), _checks.numbers(f"y0 {_path(path)}", leaf)) for path, leaf in found]
    keys = [_entry(name, i) for name, x in named for i in np.ndindex(x.shape)]
    flat = jnp.concatenate([x.ravel() for _, x in named])
    return flat, keys if names is None else names, Structure(tree, tuple(x.shape for _, x in named))


def _is_tree(y0: Any) -> bool:
    """Whether a start is a pytree other than an array and a list or tuple of numbers."""
    if type(y0) is tuple:
        return any(np.ndim(x) > 0 if hasattr(x, "shape") else _is_tree(x) for x in y0)
    return not (_is_list(y0) or hasattr(y0, "shape") or jax.tree_util.all_leaves([y0]))


def _is_list(x: Any) -> bool:
    """Whether x is a list, which stands for an array."""
    return type(x) is list


def _path(path: tuple) -> str:
    """The keys that lead to a leaf: of a dictionary, a record or a tuple."""
    known = ("key", "name", "idx")
    return ".".join(str(next(getattr(key, x) for x in known if hasattr(key, x))) for key in path)


def _entry(name: str, index: tuple[int, ...]) -> str:
    return f"{name}[{','.join(map(str, index))}]" if index else name


def _printed(tree: Any) -> str:
    return str(tree).removeprefix("PyTreeDef(").removesuffix(")")
