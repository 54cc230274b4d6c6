"""What has been found out about an object, such as a scene, and need not be found again."""

import weakref
from typing import Any, Generic, TypeVar

import jax
from jaxtyping import PyTree

T = TypeVar("T")


class ByIdentity(Generic[T]):
    """What is known of objects that cannot change, as long as they exist.

    A `weakref.WeakKeyDictionary` would compare and hash them, and arrays can do neither.
    """

    def __init__(self) -> None:
        self._known: dict[int, tuple[weakref.ref, T]] = {}

    def get(self, x: Any) -> T | None:
        """What is known of an object, None if nothing is."""
        known = self._known.get(id(x))
        return known[1] if known is not None and known[0]() is x else None

    def put(self, x: Any, value: T) -> None:
        """Keep what is known of an object."""
        key, all_ = id(x), self._known
        all_[key] = weakref.ref(x, lambda _: all_.pop(key, None)), value


#: Trees that cannot change, and what is known of each.
_noted: ByIdentity[dict[Any, Any]] = ByIdentity()


def notes_on(tree: PyTree) -> dict[Any, Any] | None:
    """What is known about a tree, by the question that was asked; kept as long as it exists.

    Returns:
      A dictionary to look in and add to; None for a tree whose numbers may change, as those of
      NumPy arrays may, or are traced.
    """
    notes = _noted.get(tree)
    if notes is not None:
        return notes
    for leaf in jax.tree.leaves(tree):
        if not isinstance(leaf, jax.Array) or isinstance(leaf, jax.core.Tracer):
            return None
    notes = {}
    _noted.put(tree, notes)
    return notes
