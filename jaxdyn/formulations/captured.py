"""Values that a function captures: global variables it reads, and the variables of its closure.

In a compiled program they are constants. If one changes afterwards, as in a notebook, a program
compiled before would silently go on with the old value. So a scene remembers a digest of what its
functions captured: a scene that is made again is compiled again, an old one is refused.

Remembered are numbers and arrays, also those in lists, dictionaries and other pytrees, in default
arguments, and in the attributes of objects, classes and modules that the function reads; and what
functions of the same module capture that it calls. What the function itself changes is left out:
it may count its calls.
"""

import dis
import functools
import hashlib
import inspect
import itertools
import types
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxdyn import _checks

#: Names of numbers and digests of their values.
Captured = tuple[tuple[str, bytes], ...]
PASS_AS_PARAMS = (
    "Pass them as params: a function is compiled once, with the values it captured then."
)
_NUMBERS = (bool, int, float, complex, np.ndarray, np.number, jax.Array)
_FUNCTIONS = (types.FunctionType, types.MethodType, functools.partial)
#: Methods with which a list, a dictionary or a set is changed.
_CHANGES = {"append", "extend", "insert", "add", "update", "setdefault", "pop", "clear"}


def _unknown() -> None:
    """Stands for built-in functions, whose code cannot be read."""


def captured(name: str, *functions: Callable) -> Captured:
    """Digests of the numbers that functions capture, hashable: a static part of a scene.

    Args:
      name: what messages call the functions.
      functions: any.
    Raises:
      ValueError: one of the numbers is being traced.
    """
    reached, attributes = _reached(functions)
    found: dict[str, bytes] = {}
    for function in reached:
        for key, value in _read_by(function).items():
            numbers = [x for x in _parts(value, attributes) if isinstance(x, _NUMBERS)]
            if _checks.is_traced(numbers):
                raise _checks.fail(
                    name, "no captured values that are traced", repr(key), PASS_AS_PARAMS
                )
            if numbers:
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


def _reached(functions: Iterable[Callable]) -> tuple[list[Callable], frozenset[str]]:
    """The functions, those of their modules that they call, and the attributes that these read."""
    reached = list(functions)
    while True:
        attributes = frozenset().union(*(_read(_plain(x).__code__).attributes for x in reached))
        # Functions of other modules are left alone: those of JAX and the like would never end.
        more = [
            part
            for function in reached
            for value in _read_by(function).values()
            for part in _parts(value, attributes)
            if isinstance(part, _FUNCTIONS)
            and _plain(part).__globals__ is _plain(function).__globals__
            and part not in reached
        ]
        if not more:
            return reached, attributes
        reached += dict.fromkeys(more)


def _plain(function: Any) -> types.FunctionType:
    """The function within partial ones, methods, wrappers and objects that can be called."""
    while not isinstance(function, types.FunctionType) or hasattr(function, "__wrapped__"):
        if isinstance(function, functools.partial):
            function = function.func
        elif isinstance(function, types.MethodType):
            function = function.__func__
        elif hasattr(function, "__wrapped__"):
            function = function.__wrapped__
        elif isinstance(called := inspect.getattr_static(type(function), "__call__"), _FUNCTIONS):
            function = called
        else:
            return _unknown
    return function


def _read_by(function: Any) -> dict[str, Any]:
    """What a function reads besides its arguments, by name."""
    plain = _plain(function)
    if isinstance(function, functools.partial):
        given = {str(i): x for i, x in enumerate(function.args)} | function.keywords
        return {"the function inside": function.func, **given}
    owner = {"self": getattr(function, "__self__", function)} if plain is not function else {}
    read, outside = _read(plain.__code__), plain.__globals__
    cells = dict(zip(plain.__code__.co_freevars, plain.__closure__ or (), strict=True))
    near = {key: cell.cell_contents for key, cell in cells.items() if _full(cell)}
    known = {key: x for key, x in (outside | near).items() if key in read.names}
    defaults = {str(i): x for i, x in enumerate(plain.__defaults__ or ())}
    return known | defaults | (plain.__kwdefaults__ or {}) | owner


def _parts(value: Any, attributes: frozenset[str]) -> Iterator[Any]:
    """Numbers and functions in a pytree of objects, in the attributes with these names."""
    waiting, seen = [value], []
    while waiting:
        for leaf in jax.tree.leaves(waiting.pop()):
            if isinstance(leaf, _NUMBERS + _FUNCTIONS):
                yield leaf
            elif not any(leaf is x for x in seen):
                seen.append(leaf)
                waiting += [_attribute(leaf, name) for name in sorted(attributes)]


def _attribute(owner: Any, name: str) -> Any:
    """An attribute without running code of its class; of a property its function."""
    found = inspect.getattr_static(owner, name, None)
    if isinstance(found, types.MemberDescriptorType) and not isinstance(owner, type):
        return getattr(owner, name, None)  # a slot
    return found.fget if isinstance(found, property) else found


class _Read(NamedTuple):
    """Names of outer variables, and of attributes of anything, that a function reads."""

    names: frozenset[str]
    attributes: frozenset[str]


@functools.cache
def _read(code: types.CodeType) -> _Read:
    """What a function reads and does not change, as it would a counter."""
    lines = list(dis.get_instructions(code))
    outer = [x for x in lines if x.opname in ("LOAD_GLOBAL", "LOAD_DEREF")]
    filled = {_line(x) for x in lines if x.opname in ("STORE_SUBSCR", "DELETE_SUBSCR")}
    grown = {x.offset for x, then in itertools.pairwise(lines) if then.argval in _CHANGES}
    changed = {x.argval for x in lines if x.opname in ("STORE_GLOBAL", "STORE_DEREF")}
    changed |= {x.argval for x in outer if _line(x) in filled or x.offset in grown}
    attributes = {x.argval for x in lines if x.opname in ("LOAD_ATTR", "LOAD_METHOD")}
    kept = {x.argval for x in lines if x.opname == "STORE_ATTR"}
    inner = [_read(x) for x in code.co_consts if isinstance(x, types.CodeType)]
    return _Read(
        frozenset({x.argval for x in outer} - changed).union(*(x.names for x in inner)),
        frozenset(attributes - kept).union(*(x.attributes for x in inner)),
    )


def _line(instruction: dis.Instruction) -> int | None:
    return instruction.positions.lineno if instruction.positions else None


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
