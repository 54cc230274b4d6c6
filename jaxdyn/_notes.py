"""What has been found out about a tree of numbers, such as a scene, and need not be found again."""

import weakref
from typing import Any

import jax
from jaxtyping import PyTree

#: Trees that cannot change, by their id, and what is known of each.
_noted: dict[int, tuple[weakref.ref, dict[Any, Any]]] = {}


def notes_on(tree: PyTree) -> dict[Any, Any] | None:
    """What is known about a tree, by what was asked; kept as long as it exists.

    Returns:
      A dictionary to look in and add to; None for a tree whose numbers may change, as those of
      NumPy arrays may, or are traced.
    """
    key = id(tree)
    noted = _noted.get(key)
    if noted is not None and noted[0]() is tree:
        return noted[1]
    for leaf in jax.tree.leaves(tree):
        if not isinstance(leaf, jax.Array) or isinstance(leaf, jax.core.Tracer):
            return None
    notes: dict[Any, Any] = {}
    _noted[key] = weakref.ref(tree, lambda _: _noted.pop(key, None)), notes
    return notes
