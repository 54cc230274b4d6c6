"""Numbers that a function takes from around it: global variables, and those of a closure.

In a compiled program they are constants. If one changes afterwards, as in a notebook, the program
that was compiled for the function goes on with the old one and its results are wrong without a
word. So a scene remembers them: one that is made again is compiled again, one that is used again is
refused.

What is looked at are numbers, arrays and tuples or modules of them, those of functions of the same
module that it calls too; not lists and dictionaries, in which a function may also count.
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
Surroundings = tuple[tuple[str, bytes], ...]
AGAIN = (
    "Pass them as params: a function is compiled once, and what it takes from around it then stays."
)
_NUMBERS = bool | int | float | complex | np.ndarray | np.number | Array


def surroundings(name: str, *functions: Callable) -> Surroundings:
    """The numbers that functions take from around them, hashable: a static part of a scene.

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
                raise _checks.fail(name, "no traced values from around it", repr(key), AGAIN)
            elif numbers := [x for x in jax.tree.leaves(value) if isinstance(x, _NUMBERS)]:
                found[key] = _digest(numbers)
    return tuple(sorted(found.items()))


def check_surroundings(name: str, then: Surroundings, *functions: Callable) -> None:
    """Raise ValueError if a number around the functions is not what it was then."""
    changed = {repr(key) for key, _ in set(then) ^ set(surroundings(name, *functions))}
    if changed:
        got = f"another value of {', '.join(sorted(changed))}"
        remedy = "Make the scene again, or pass what changes as params."
        raise _checks.fail(name, "the numbers around it as they were", got, remedy)


def _read_by(function: Any) -> dict[str, Any]:
    """What a function reads that it is not given, by name."""
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
    """Names from around a program that it reads and does not set, as a counter would be."""
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
    """16 bytes that other numbers do not have."""
    digest = hashlib.blake2b(digest_size=16)
    for x in map(np.asarray, numbers):
        digest.update(f"{x.shape}{x.dtype}".encode() + x.tobytes())
    return digest.digest()
