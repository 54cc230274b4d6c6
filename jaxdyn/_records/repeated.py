"""Whether a function of a user depends on its arguments alone.

A compiled program calls it once, when it is traced: what it draws from a generator of random
numbers, or reads from a clock, would silently be the same in every step. Traced twice, such a
function gives two programs with different numbers in them.
"""

import functools
import re
from typing import Any

import jax
import numpy as np

from jaxdyn._text import fail

_REMEDY = (
    "What it draws at random or reads from a clock would be the same in every step: draw it "
    "before, and pass it as params (of a class, as a field), or read it from a table by time."
)


def check_repeatable(record: Any, method: str, *args: Any) -> None:
    """Raise ValueError if a method of a record gives another program when it is traced again.

    Args:
      record: any record; nothing is done for one without functions of a user.
      method: name of its method.
      args: pytrees of arrays, of which only the shapes are used.
    """
    if record.captured is None:
        return
    leaves, tree = jax.tree.flatten((record, args))
    if not _is_repeatable(method, tree, tuple((x.shape, x.dtype) for x in map(_as_array, leaves))):
        name = f"{type(record).__name__}.{method}"
        got = "one that gives other numbers when it is called again"
        raise fail(name, "a function of its arguments alone", got, _REMEDY)


def _as_array(x: Any) -> Any:
    return x if hasattr(x, "dtype") else np.asarray(x)


@functools.lru_cache
def _is_repeatable(method: str, tree: Any, shapes: tuple) -> bool:
    leaves = [jax.ShapeDtypeStruct(*shape) for shape in shapes]
    first, then = (_program(method, tree, leaves) for _ in range(2))
    return first == then


def _program(method: str, tree: Any, leaves: list) -> tuple[str, list[bytes]]:
    """The program of a method as text without addresses, and the arrays in it."""

    def call(*leaves):  # another function each time, or JAX would not trace it again
        record, args = jax.tree.unflatten(tree, leaves)
        return getattr(record, method)(*args)

    traced = jax.make_jaxpr(call)(*leaves)
    text = re.sub("0x[0-9a-f]+", "", str(traced.jaxpr))
    return text, [np.asarray(x).tobytes() for x in traced.consts]
