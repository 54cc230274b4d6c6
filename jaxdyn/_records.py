"""Records: the parts of a scene, pytrees that remember what their functions captured.

`Record` is the class of systems, effects, events and other parts of a scene, and says how they are
pickled. What a user's functions read besides their arguments is found in their code; whether it has
changed since is checked before each run, and whether they depend on their arguments alone when they
are traced. `notes_on` keeps what was found out about a record as long as it exists.

To add a kind of record, write a subclass of `Record`; an entry point that takes one calls its
`check_functions`.
"""

import dataclasses
import dis
import functools
import hashlib
import inspect
import itertools
import pickle
import re
import sys
import sysconfig
import types
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from jaxdyn._checks import check_callable
from jaxdyn._doors import with_present_names
from jaxdyn._text import fail

# ---- What has been found out about a scene and need not be found again

T = TypeVar("T")


class ByIdentity(Generic[T]):
    """Results about objects that cannot change, kept as long as these exist.

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


# ---- Values that a user's function captures: global variables, and the variables of its closure
#
# In a compiled program they are constants. If one changes afterwards, as in a notebook, a program
# compiled before would silently keep using the old value. So a `Record` (a system, an effect, an
# event) remembers a digest of what its functions and its methods captured: a record that is made
# again is compiled again, and an old one is refused.
#
# It remembers numbers and arrays, including those in lists, dictionaries and other pytrees, in
# default arguments, and in the attributes of objects, classes and modules that the function reads.
# It also remembers what the functions that it calls captured, except those of installed packages.
# What the function itself changes is left out: it may count its calls. Functions of this library
# capture nothing that changes.
#
# What a function reads besides its arguments is found in its code, without running it: global
# variables, variables of closures, defaults and owners, by name; and the numbers and the functions
# in them, in the attributes that the functions read.

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
    near = {key: cell.cell_contents for key, cell in cells.items() if has_value(cell)}
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
    own = set(code.co_cellvars)  # its own variables, which functions inside it read
    return _Read(
        frozenset({x.argval for x in outer} - changed).union(*(x.names for x in inner)) - own,
        frozenset(attributes - kept).union(*(x.attributes for x in inner)),
    )


def _line(instruction: dis.Instruction) -> int | None:
    return instruction.positions.lineno if instruction.positions else None


def has_value(cell: types.CellType) -> bool:
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
_FOLLOW_OUTSIDE = (
    "Call it outside of jit, grad and vmap: orbits.differentiable has the derivatives of what it "
    "finds."
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
#: Largest number of functions whose captured values are cached; beyond it the cache is emptied.
_MOST_KEPT = 4096


def captures_of_record(record: eqx.Module) -> Captured | None:
    """What the user's functions in a record captured; None if neither it nor its parts have any."""
    functions, parts, _ = _walk(record)
    if functions or any(part.captured is not None for part in parts):
        return captures(type(record).__name__, *functions)
    return None


def check_captured(record: Any) -> None:
    """Raise ValueError if a number that a record or its parts captured has changed since then."""
    if record.captured is None:
        return
    # The contents are not kept in the record: Equinox takes what is in its __dict__ beside the
    # fields as a part of its structure, so it would no longer match one with the same fields.
    functions, parts = _kept_walk(record)
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


def _kept_walk(record: Any) -> tuple[tuple[Callable, ...], list[Any]]:
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

    The last result says whether these are fixed: a list or a dictionary may get others.
    """
    functions, records, for_good = _methods(type(record)), [], True
    waiting = [record.__dict__.values()]
    while waiting:
        for x in waiting.pop():
            kind = _kind_of_content(type(x))
            if kind is None:
                continue
            if kind == "record":
                records.append(x)
            elif kind == "function":
                functions += _functions_of_user(x)
            elif kind == "module":
                functions += _methods(type(x))
                waiting.append(x.__dict__.values())
            else:
                for_good = for_good and isinstance(x, tuple)
                waiting.append(x.values() if kind == "dictionary" else x)
    return functions, records, for_good


@functools.cache
def _kind_of_content(kind: type) -> str | None:
    """How functions are sought in objects of a type; None where there are none."""
    if issubclass(kind, eqx.Module):
        return "record" if "captured" in kind.__dataclass_fields__ else "module"
    if issubclass(kind, dict):
        return "dictionary"
    if issubclass(kind, tuple | list):
        return "sequence"
    called = any("__call__" in vars(cls) for cls in kind.__mro__)
    return "function" if called else None


def _functions_of_user(function: Any) -> tuple[Callable, ...]:
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


def captures(name: str, *functions: Callable, remedy: str = PASS_AS_PARAMS) -> Captured:
    """Digests of the numbers that functions capture, hashable: a static part of a record.

    Args:
      name: what messages call the functions.
      functions: any.
      remedy: what to do where one of the numbers is being traced.
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
                raise fail(name, "no captured values that are traced", repr(key), remedy)
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


def with_captures(make: Callable, *arguments: str) -> Remembered:
    """A function that makes scenes, with what it captures now.

    If arguments are named, it must accept these, by position.

    Raises:
      ValueError: the function takes other arguments, or was `Remembered` before and what it
        captured has changed since.
    """
    if arguments:
        check_callable("make", make, *arguments)
    if not isinstance(make, Remembered):
        return Remembered(make, captures("make", make, remedy=_FOLLOW_OUTSIDE))
    if captures("make", make.function, remedy=_FOLLOW_OUTSIDE) != make.captured:
        expected = "the values it captured when what is continued was made"
        raise fail("make", expected, "others", "Begin again, from the first scene.")
    return make


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
            # A wrapper, such as that of `jax.grad`, has variables of its own.
            if not isinstance(function, types.MethodType) or not _by_identity((function,)):
                return None
            for cls in function.__self__.__mro__:
                own = () if of_library(cls.__module__) else vars(cls).keys() & attributes
                found += [_Place(vars(cls), name, vars(cls)[name]) for name in own]
        cells = zip(inside.__code__.co_freevars, inside.__closure__ or (), strict=True)
        near = {key: cell for key, cell in cells if has_value(cell)}
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
    for x in map(_host_value, numbers):
        digest.update(f"{x.shape}{x.dtype}".encode() + x.tobytes())
    return digest.digest()


def _host_value(x: Any) -> np.ndarray:
    """A number or an array as an array of NumPy; of a key of `jax.random`, what it consists of."""
    is_key = isinstance(x, jax.Array) and jax.numpy.issubdtype(x.dtype, jax.dtypes.prng_key)
    return np.asarray(jax.random.key_data(x) if is_key else x)


# ---- Whether a function of a user depends on its arguments alone
#
# A compiled program calls it once, when it is traced: what it draws from a generator of random
# numbers, or reads from a clock, would silently be the same in every step. Traced twice, such a
# function gives two programs with different numbers in them.

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
    return text, [_host_value(x).tobytes() for x in traced.consts]


# ---- Records that hold functions which pickle cannot find by name: lambdas, inner functions
#
# Pickle stores the name of a function, and lambdas have none. They are stored by the package
# cloudpickle, which stores their code.


class Stored:
    """A function in a pickled record; a copy of the record shares it."""

    def __init__(self, function: types.FunctionType):
        self.function = function

    def __deepcopy__(self, memo: dict) -> "Stored":
        return self

    def __reduce__(self) -> tuple:
        try:
            import cloudpickle
        except ImportError as error:
            name = self.function.__qualname__
            remedy = "Define it by `def` at the top level of a module, or install cloudpickle."
            raise fail("pickle", "functions that have a name", name, remedy) from error
        return _load_function, (cloudpickle.dumps(self.function),)


def _load_function(code: bytes) -> Stored:
    return Stored(pickle.loads(code))


def state_of(record: Any) -> dict[str, Any]:
    """The fields of a record as pickle can store them."""
    names = [field.name for field in dataclasses.fields(record) if field.name in record.__dict__]
    return {name: _map_functions(_to_stored, record.__dict__[name]) for name in names}


def fields_of(state: dict[str, Any]) -> dict[str, Any]:
    """The fields of a record from what `state_of` returned."""
    return {name: _map_functions(_from_stored, value) for name, value in state.items()}


def _map_functions(change: Any, value: Any) -> Any:
    """A field with its functions changed, in tuples, lists and dictionaries, too."""
    if isinstance(value, tuple | list | dict | types.FunctionType | Stored):
        return jax.tree.map(change, value, is_leaf=lambda x: isinstance(x, eqx.Module))
    return value


def _to_stored(x: Any) -> Any:
    return Stored(x) if isinstance(x, types.FunctionType) and not _has_name(x) else x


def _from_stored(x: Any) -> Any:
    return x.function if isinstance(x, Stored) else x


def _has_name(function: types.FunctionType) -> bool:
    try:
        return bool(pickle.dumps(function))
    except (pickle.PicklingError, AttributeError):
        return False


# ---- `Record`, the class of systems, effects, events and other parts of a scene, with functions

if TYPE_CHECKING:

    class Record(eqx.Module):
        """What type checkers see of the class below."""

        captured: Captured | None = eqx.field(static=True, init=False, repr=False)

        @property
        def converted(self) -> list[Any]: ...

        def check_functions(self) -> None: ...

else:

    class _RecordMeta(type(eqx.Module)):
        def __init__(cls, *args, **kwargs):
            super().__init__(*args, **kwargs)
            fields = dataclasses.fields(cls)
            cls._field_names = frozenset(f.name for f in fields if f.init)
            cls._converters = tuple(
                (f.name, f.metadata["converter"]) for f in fields if "converter" in f.metadata
            )
            checks = (owner.__dict__.get("__check_init__") for owner in cls.__mro__)
            cls._own_checks = tuple(check for check in checks if check)

        def __call__(cls, *args, **kwargs):
            made = object.__new__(cls)  # raises TypeError for abstract classes
            if kwargs and cls._renamed:
                kwargs = with_present_names(cls.__name__, kwargs, cls._renamed)
            cls.__init__(made, *args, **kwargs)
            values = made.__dict__
            missing = cls._field_names - values.keys()
            if missing or cls.__abstractvars__:
                names = ", ".join(sorted(missing | cls.__abstractvars__))
                raise TypeError(f"{cls.__name__} has no value for {names}")
            for name, convert in cls._converters:
                values[name] = convert(values[name])
            values["captured"] = captures_of_record(made)
            for check in cls._own_checks:
                check(made)
            return made

    class Record(eqx.Module, metaclass=_RecordMeta):
        """An equinox module without what equinox does at each access and each assignment.

        An equinox module returns its methods as pytrees, and notices assignments: a record of
        three fields takes 11 us to make and 1 us per attribute, but here 2 us and 0.03 us
        [measured; an empty compiled call takes 5 us]. Methods are those of Python:
        ``jax.jit(scene.rate)`` is compiled for this scene alone; `Scene.vector_field` is a
        pytree, and compiled once for all scenes of a kind, as what `Scene.rate` calls.

        Attributes:
          captured: what the user's functions in it captured when it was made, with which programs
            are compiled; None without such functions. See `captures`.
        """

        captured: Captured | None = eqx.field(static=True, init=False, repr=False)
        _renamed: ClassVar[Mapping[str, str]] = {}

        __getattribute__ = object.__getattribute__

        def __setattr__(self, name: str, value: Any) -> None:
            # The constructor assigns each field once; nothing else assigns.
            if name not in type(self)._field_names or name in self.__dict__:
                raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
            self.__dict__[name] = value

        def __getstate__(self) -> dict[str, Any]:
            return state_of(self)

        def __setstate__(self, state: dict[str, Any]) -> None:
            self.__dict__.update(fields_of(state))

        @property
        def converted(self) -> list[Any]:
            """The numbers that were converted when it was made; others are as they were given."""
            return [self.__dict__[name] for name, _ in type(self)._converters]

        def check_functions(self) -> None:
            """Raise ValueError if a number that one of its functions captured has changed since.

            Unlike its own numbers, which cannot change, these are checked in every call.
            """
            check_captured(self)
