"""What functions read besides their arguments: found in their code, without running it.

Global variables, variables of closures, defaults and owners, by name; and the numbers and the
functions in them, in the attributes that the functions read.
"""

import dis
import functools
import inspect
import itertools
import sysconfig
import types
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

NUMBERS = (bool, int, float, complex, np.ndarray, np.number, jax.Array)
FUNCTIONS = (types.FunctionType, types.MethodType, functools.partial)
#: Methods with which a list, a dictionary or a set is changed.
_CHANGES = {"append", "extend", "insert", "add", "update", "setdefault", "pop", "clear"}
_ATTRIBUTES = ("LOAD_ATTR", "LOAD_METHOD")
#: What these packages contain does not change.
_LIBRARIES = {"jaxdyn", "orbits", "jax", "jaxlib", "numpy", "equinox", "diffrax", "builtins"}
_INSTALLED = tuple(sysconfig.get_paths()[key] for key in ("purelib", "platlib", "stdlib"))


def _unknown() -> None:
    """Stands for built-in functions, whose code cannot be read."""


@functools.cache
def of_library(module: str | None) -> bool:
    """Whether a module belongs to this library, or to one that it is made of."""
    return module is None or module.partition(".")[0] in _LIBRARIES


def reached_from(functions: Iterable[Callable]) -> tuple[list[Callable], frozenset[str]]:
    """The functions, those of their modules that they call, and the attributes that these read."""
    reached = list(functions)
    while True:
        attributes = frozenset().union(*(code_reads(plain(x).__code__).attributes for x in reached))
        # Functions of installed packages are left alone: those of JAX would never end.
        more = [
            part
            for function in reached
            for value in read_by(function).values()
            for part in parts_of(value, attributes)
            if isinstance(part, FUNCTIONS)
            and not _installed(plain(part), plain(function))
            and part not in reached
        ]
        if not more:
            return reached, attributes
        reached += dict.fromkeys(more)


def _installed(called: types.FunctionType, by: types.FunctionType) -> bool:
    """Whether a function that another one calls is of a package that the latter only uses."""
    if called.__globals__ is by.__globals__:
        return False
    return of_library(called.__module__) or called.__code__.co_filename.startswith(_INSTALLED)


def plain(function: Any) -> types.FunctionType:
    """The function within partial ones, methods, wrappers and objects that can be called."""
    while not isinstance(function, types.FunctionType) or hasattr(function, "__wrapped__"):
        if isinstance(function, functools.partial):
            function = function.func
        elif isinstance(function, types.MethodType):
            function = function.__func__
        elif hasattr(function, "__wrapped__"):
            function = function.__wrapped__
        elif isinstance(called := inspect.getattr_static(type(function), "__call__"), FUNCTIONS):
            function = called
        else:
            return _unknown
    return function


def read_by(function: Any) -> dict[str, Any]:
    """What a function reads besides its arguments, by name."""
    inside = plain(function)
    if isinstance(function, functools.partial):
        given = {str(i): x for i, x in enumerate(function.args)} | function.keywords
        return {"the function inside": function.func, **given}
    owner = {}
    if inside is not function:
        owned = getattr(function, "__self__", function)
        owner = {owned.__name__ if isinstance(owned, type) else "self": owned}
    read, outside = code_reads(inside.__code__), inside.__globals__
    cells = dict(zip(inside.__code__.co_freevars, inside.__closure__ or (), strict=True))
    near = {key: cell.cell_contents for key, cell in cells.items() if full(cell)}
    known = {key: outside[key] for key in read.names if key in outside}
    known |= {key: x for key, x in near.items() if key in read.names}
    defaults = {str(i): x for i, x in enumerate(inside.__defaults__ or ())}
    return known | defaults | (inside.__kwdefaults__ or {}) | owner


def parts_of(value: Any, attributes: frozenset[str]) -> Iterator[Any]:
    """Numbers and functions in a pytree of objects, in the attributes with these names."""
    waiting, seen = [value], []
    while waiting:
        for leaf in jax.tree.leaves(waiting.pop()):
            if isinstance(leaf, NUMBERS + FUNCTIONS):
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
def code_reads(code: types.CodeType) -> _Read:
    """What a function reads and does not change, as it would a counter."""
    lines = list(dis.get_instructions(code))
    outer = [x for x in lines if x.opname in ("LOAD_GLOBAL", "LOAD_DEREF")]
    filled = {_line(x) for x in lines if x.opname in ("STORE_SUBSCR", "DELETE_SUBSCR")}
    grown = {x.offset for x, then in itertools.pairwise(lines) if then.argval in _CHANGES}
    changed = {x.argval for x in lines if x.opname in ("STORE_GLOBAL", "STORE_DEREF")}
    changed |= {x.argval for x in outer if _line(x) in filled or x.offset in grown}
    attributes = {x.argval for x in lines if x.opname in _ATTRIBUTES}
    kept = {x.argval for x in lines if x.opname == "STORE_ATTR"}
    kept |= {x.argval for x in lines if x.opname in _ATTRIBUTES and x.offset in grown}
    inner = [code_reads(x) for x in code.co_consts if isinstance(x, types.CodeType)]
    return _Read(
        frozenset({x.argval for x in outer} - changed).union(*(x.names for x in inner)),
        frozenset(attributes - kept).union(*(x.attributes for x in inner)),
    )


def _line(instruction: dis.Instruction) -> int | None:
    return instruction.positions.lineno if instruction.positions else None


def full(cell: types.CellType) -> bool:
    """Whether a variable of a closure has a value yet."""
    try:
        _ = cell.cell_contents
    except ValueError:
        return False
    return True
