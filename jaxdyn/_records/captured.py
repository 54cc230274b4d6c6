"""Values that a user's function captures: global variables, and the variables of its closure.

In a compiled program they are constants. If one changes afterwards, as in a notebook, a program
compiled before would silently go on with the old value. So a `Record` (a system, an effect, an
event) remembers a digest of what its functions and its methods captured: a record that is made
again is compiled again, and an old one is refused.

It remembers numbers and arrays, including those in lists, dictionaries and other pytrees, in
default arguments, and in the attributes of objects, classes and modules that the function reads. It
also remembers what the functions that it calls captured, except those of installed packages. What
the function itself changes is left out: it may count its calls. Functions of this library capture
nothing that changes.

What a function reads besides its arguments is found in its code, without running it: global
variables, variables of closures, defaults and owners, by name; and the numbers and the functions
in them, in the attributes that the functions read.
"""

import dis
import functools
import hashlib
import inspect
import itertools
import sys
import sysconfig
import types
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from jaxdyn._records.notes import ByIdentity
from jaxdyn._text import fail

NUMBERS = (bool, int, float, complex, np.ndarray, np.number, jax.Array)
FUNCTIONS = (types.FunctionType, types.MethodType, functools.partial)
#: Methods with which a list, a dictionary or a set is changed.
_CHANGES = {"append", "extend", "insert", "add", "update", "setdefault", "pop", "clear"}
_ATTRIBUTES = ("LOAD_ATTR", "LOAD_METHOD")
#: What these packages contain does not change.
_LIBRARIES = {"jaxdyn", "orbits", "jax", "jaxlib", "numpy", "equinox", "diffrax", "builtins"}
_INSTALLED = tuple(sysconfig.get_paths()[key] for key in ("purelib", "platlib", "stdlib"))


def _unreadable() -> None:
    """Stands for built-in functions, whose code cannot be read."""


@functools.cache
def of_library(module: str | None) -> bool:
    """Whether a module belongs to this library, or to one that it is made of."""
    return module is None or module.partition(".")[0] in _LIBRARIES


def reachable_from(functions: Iterable[Callable]) -> tuple[list[Callable], frozenset[str]]:
    """The functions with those that they call in turn, and the attributes that these read."""
    reached = list(functions)
    while True:
        attributes = frozenset().union(
            *(code_reads(innermost_function(x).__code__).attributes for x in reached)
        )
        # Functions of installed packages are left alone: those of JAX would never end.
        more = [
            part
            for function in reached
            for value in reads_of(function).values()
            for part in parts_of(value, attributes)
            if isinstance(part, FUNCTIONS)
            and not _is_installed(innermost_function(part), innermost_function(function))
            and part not in reached
        ]
        if not more:
            return reached, attributes
        reached += dict.fromkeys(more)


def _is_installed(called: types.FunctionType, by: types.FunctionType) -> bool:
    """Whether a function that another one calls is of a package that the latter merely uses."""
    if called.__globals__ is by.__globals__:
        return False
    return of_library(called.__module__) or called.__code__.co_filename.startswith(_INSTALLED)


def innermost_function(function: Any) -> types.FunctionType:
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
            return _unreadable
    return function


def reads_of(function: Any) -> dict[str, Any]:
    """What a function reads besides its arguments, by name."""
    inside = innermost_function(function)
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
    """An attribute, without running code of its class; for a property, its function."""
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
    """What a function reads, except what it changes itself, such as a counter."""
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


#: Names of numbers and digests of their values.
Captured = tuple[tuple[str, bytes], ...]
PASS_AS_PARAMS = (
    "Pass them as params: a function is compiled once, with the values it captured then."
)
_MAKE_AGAIN = (
    "Make the scene or the event again, or pass what changes as params; of a class, as a field."
)
#: Types whose values cannot change in place: another value is another object.
_FIXED = (
    *(bool, int, float, complex, str, bytes, type(None), np.number, jax.Array),
    *(types.FunctionType, types.BuiltinFunctionType, property),
)
#: The contents of records whose parts cannot be exchanged.
_held_for_good: ByIdentity[tuple[tuple[Callable, ...], list[Any]]] = ByIdentity()
#: Number of functions whose captured values are kept at hand; beyond it all are read anew.
_MOST_KEPT = 4096


def captures_of_record(record: eqx.Module) -> Captured | None:
    """What the user's functions in a record captured; None if neither it nor its parts have any."""
    functions, parts, _ = _walk(record)
    if functions or any(part.captured is not None for part in parts):
        return captures(type(record).__name__, *functions)
    return None


def check_captured(record: Any) -> None:
    """Raise ValueError if a number that a record or its parts captured is not what it was then."""
    if record.captured is None:
        return
    # The contents are not kept in the record: Equinox takes what is in its __dict__ beside the
    # fields as a part of its structure, so it would no longer match one with the same fields.
    functions, parts = _contents(record)
    for part in parts:
        check_captured(part)
    if not functions:
        return
    name, then = type(record).__name__, record.captured
    now = captures(name, *functions)
    if now != then:
        changed = ", ".join(sorted({repr(key) for key, _ in set(then) ^ set(now)}))
        got = f"another value of {changed}"
        raise fail(name, "captured numbers that have not changed", got, _MAKE_AGAIN)


def _contents(record: Any) -> tuple[tuple[Callable, ...], list[Any]]:
    """The functions and records of `_walk`, from an earlier walk where they cannot change."""
    known = _held_for_good.get(record)
    if known is not None:
        return known
    functions, records, for_good = _walk(record)
    if for_good:
        _held_for_good.put(record, (functions, records))
    return functions, records


def _walk(record: Any) -> tuple[tuple[Callable, ...], list[Any], bool]:
    """The user's functions in a record, including its methods, and the records in it.

    The last result says whether these are fixed: a list or a dictionary may get other ones.
    """
    functions, records, for_good = _methods(type(record)), [], True
    waiting = [record.__dict__.values()]
    while waiting:
        for x in waiting.pop():
            way = _way(type(x))
            if way is None:
                continue
            if way == "record":
                records.append(x)
            elif way == "function":
                functions += _of_user(x)
            elif way == "module":
                functions += _methods(type(x))
                waiting.append(x.__dict__.values())
            else:
                for_good = for_good and isinstance(x, tuple)
                waiting.append(x.values() if way == "dictionary" else x)
    return functions, records, for_good


@functools.cache
def _way(kind: type) -> str | None:
    """How functions are sought in objects of a type; None where there are none."""
    if issubclass(kind, eqx.Module):
        return "record" if "captured" in kind.__dataclass_fields__ else "module"
    if issubclass(kind, dict):
        return "dictionary"
    if issubclass(kind, tuple | list):
        return "sequence"
    called = any("__call__" in vars(cls) for cls in kind.__mro__)
    return "function" if called else None


def _of_user(function: Any) -> tuple[Callable, ...]:
    """A user's function in a tuple; of a function of this library, its owner's user methods."""
    if type(function) is functools.partial or not of_library(
        innermost_function(function).__module__
    ):
        return (function,)
    owner = getattr(function, "__self__", None)
    return _methods(type(owner)) if isinstance(owner, eqx.Module) else ()


@functools.cache
def _methods(kind: type) -> tuple[Callable, ...]:
    """Methods and properties that a class or its bases define, without those of this library.

    Each is bound to its class, whose attributes it may read through `self`.
    """
    found = []
    for cls in kind.__mro__:
        for name in () if of_library(cls.__module__) else vars(cls):
            member = inspect.getattr_static(cls, name)
            member = getattr(member, "fget", None) or getattr(member, "func", None) or member
            member = getattr(member, "__func__", member)
            if callable(member) and (name == "__call__" or name[:2] != "__"):
                if not of_library(innermost_function(member).__module__):
                    found.append(types.MethodType(innermost_function(member), kind))
    return tuple(found)


def captures(name: str, *functions: Callable) -> Captured:
    """Digests of the numbers that functions capture, hashable: a static part of a record.

    Args:
      name: what messages call the functions.
      functions: any.
    Raises:
      ValueError: one of the numbers is being traced.
    """
    kept = _kept.get(functions) if _by_identity(functions) else None
    if kept is not None and all(place.holds() for place in kept.places):
        return kept.captured
    reached, attributes = reachable_from(functions)
    found: dict[str, bytes] = {}
    for function in reached:
        for key, value in reads_of(function).items():
            numbers = [x for x in parts_of(value, attributes) if isinstance(x, NUMBERS)]
            if any(isinstance(x, jax.core.Tracer) for x in numbers):
                raise fail(name, "no captured values that are traced", repr(key), PASS_AS_PARAMS)
            if numbers:
                # Two functions may capture different values under one name.
                found[key] = found.get(key, b"") + _digest(numbers)
    result = tuple(sorted(found.items()))
    places = _places(reached, attributes)
    if places is not None:
        if len(_kept) >= _MOST_KEPT:
            _kept.clear()
        _kept[functions] = _Kept(result, places)
    return result


class Remembered(NamedTuple):
    """A function with what it captured: a new value makes another function, compiled anew.

    Attributes:
      function: any.
      captured: see `captures`.
    """

    function: Callable
    captured: Captured

    def __call__(self, *args: Any) -> Any:
        return self.function(*args)

    @property
    def __wrapped__(self) -> Callable:
        return self.function

    @property
    def __name__(self) -> str:
        return getattr(self.function, "__name__", type(self.function).__name__)


def with_captures(name: str, function: Callable) -> Remembered:
    """A function that makes scenes, with what it captures now.

    Raises:
      ValueError: the function has been given so before, and what it captured has changed since.
    """
    if not isinstance(function, Remembered):
        return Remembered(function, captures(name, function))
    if captures(name, function.function) != function.captured:
        expected = "the values it captured when what is continued was made"
        raise fail(name, expected, "others", "Begin again, from the first scene.")
    return function


class _Place(NamedTuple):
    """A variable, and the object in it; a cell of a closure has no name."""

    holder: Any
    name: str | None
    value: Any

    def holds(self) -> bool:
        """Whether it is still this object."""
        if self.name is None:
            return self.holder.cell_contents is self.value
        return self.holder.get(self.name) is self.value


class _Kept(NamedTuple):
    """What functions captured, for as long as all their variables hold the same objects."""

    captured: Captured
    places: tuple[_Place, ...]


_kept: dict[tuple[Callable, ...], _Kept] = {}


def _by_identity(functions: tuple[Callable, ...]) -> bool:
    """Whether all are plain functions, or methods of classes, which are equal only if the same."""
    return all(
        type(x) is types.FunctionType
        or (type(x) is types.MethodType and isinstance(x.__self__, type))
        for x in functions
    )


def _places(functions: list[Callable], attributes: frozenset[str]) -> tuple[_Place, ...] | None:
    """The variables that functions read; None if one holds an object that may change in place."""
    found: list[_Place] = []
    for function in functions:
        inside = innermost_function(function)
        if inside.__defaults__ or inside.__kwdefaults__:
            return None
        if function is not inside:
            if not _by_identity((function,)):
                return None
            for cls in function.__self__.__mro__:
                own = () if of_library(cls.__module__) else vars(cls).keys() & attributes
                found += [_Place(vars(cls), name, vars(cls)[name]) for name in own]
        cells = zip(inside.__code__.co_freevars, inside.__closure__ or (), strict=True)
        near = {key: cell for key, cell in cells if full(cell)}
        if len(near) < len(inside.__code__.co_freevars):
            return None  # one may yet have a value
        for key in code_reads(inside.__code__).names:
            if key in near:
                found.append(_Place(near[key], None, near[key].cell_contents))
            else:
                found.append(_Place(inside.__globals__, key, inside.__globals__.get(key)))
    return tuple(found) if all(_is_constant(place.value) for place in found) else None


def _is_constant(value: Any) -> bool:
    """Whether an object cannot change; functions are examined separately."""
    if isinstance(value, tuple):
        return all(map(_is_constant, value))
    if isinstance(value, types.ModuleType):
        return of_library(value.__name__) or value.__name__ in sys.stdlib_module_names
    if isinstance(value, type):
        return of_library(value.__module__)
    if isinstance(value, _FIXED):
        return True
    # Functions of JAX have types of their own.
    return callable(value) and of_library(type(value).__module__)


def _digest(numbers: list) -> bytes:
    """16 bytes that differ for other numbers."""
    digest = hashlib.blake2b(digest_size=16)
    for x in map(np.asarray, numbers):
        digest.update(f"{x.shape}{x.dtype}".encode() + x.tobytes())
    return digest.digest()
