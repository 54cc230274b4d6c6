"""Values that a function captures: global variables it reads, and the variables of its closure.

In a compiled program they are constants. If one changes afterwards, as in a notebook, a program
compiled before would silently go on with the old value. So a scene remembers a digest of what its
functions captured: a scene that is made again is compiled again, an old one is refused.

Numbers, arrays and pytrees of them are remembered, also those of functions of the same module that
the function calls. Lists and dictionaries are not: a function may count in them.
"""

import dis
import functools
import hashlib
import inspect
import types
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks

#: Names of numbers and digests of their values.
Captured = tuple[tuple[str, bytes], ...]
PASS_AS_PARAMS = (
    "Pass them as params: a function is compiled once, with the values it captured then."
)
_NUMBERS = bool | int | float | complex | np.ndarray | np.number | Array


def captured(name: str, *functions: Callable) -> Captured:
    """Digests of the numbers that functions capture, hashable: a static part of a scene.

    Args:
      name: what messages call the functions.
      functions: any.
    Raises:
      ValueError: one of the numbers is being traced.
    """
    found: dict[str, bytes] = {}
    waiting, seen = list(functions), set()
    while waiting:
        function = waiting.pop()
        if function in seen:
            continue
        seen.add(function)
        for key, value in _read_by(function).items():
            if isinstance(value, types.FunctionType | functools.partial):
                waiting.append(value)
            elif isinstance(value, list | dict):
                continue
            elif _checks.is_traced(value):
                raise _checks.fail(
                    name, "no captured values that are traced", repr(key), PASS_AS_PARAMS
                )
            elif numbers := [x for x in jax.tree.leaves(value) if isinstance(x, _NUMBERS)]:
                # Two functions may capture different values under one name.
                found[key] = found.get(key, b"") + _digest(numbers)
    return tuple(sorted(found.items()))


def check_captured(name: str, then: Captured, *functions: Callable) -> None:
    """Raise ValueError if a captured number is not what it was then."""
    changed = {repr(key) for key, _ in set(then) ^ set(captured(name, *functions))}
    if changed:
        got = f"another value of {', '.join(sorted(changed))}"
        remedy = "Make the scene again, or pass what changes as params."
        raise _checks.fail(name, "captured numbers that have not changed", got, remedy)


def _read_by(function: Any) -> dict[str, Any]:
    """What a function reads besides its arguments, by name."""
    if isinstance(function, functools.partial):
        given = {str(i): x for i, x in enumerate(function.args)} | function.keywords
        return {"the function inside": function.func, **given}
    function = inspect.unwrap(function)
    if not isinstance(function, types.FunctionType):
        return {}
    outside, names = function.__globals__, _read(function.__code__)
    cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    near = {key: cell.cell_contents for key, cell in cells.items() if key in names and _full(cell)}
    far = {key: outside[key] for key in names - near.keys() if key in outside}
    # Functions of other modules are left alone: those of JAX and the like would never end.
    return near | {
        key: value
        for key, value in far.items()
        if getattr(value, "__globals__", outside) is outside
    }


@functools.cache
def _read(code: types.CodeType) -> frozenset[str]:
    """Names of outer variables that a function reads and does not set, as it would a counter."""
    lines = [(line.opname, line.argval) for line in dis.get_instructions(code)]
    read = {name for op, name in lines if op in ("LOAD_GLOBAL", "LOAD_DEREF")}
    kept = {name for op, name in lines if op in ("STORE_GLOBAL", "STORE_DEREF")}
    inner = (x for x in code.co_consts if isinstance(x, types.CodeType))
    return frozenset(read - kept).union(*map(_read, inner))


def _full(cell: types.CellType) -> bool:
    """Whether a variable of a closure has a value yet."""
    try:
        return cell.cell_contents is not None
    except ValueError:
        return False


def _digest(numbers: list) -> bytes:
    """16 bytes that differ for other numbers."""
    digest = hashlib.blake2b(digest_size=16)
    for x in map(np.asarray, numbers):
        digest.update(f"{x.shape}{x.dtype}".encode() + x.tobytes())
    return digest.digest()
