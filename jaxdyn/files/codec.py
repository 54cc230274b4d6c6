"""The codec: how a value becomes plain JSON, and how JSON becomes a value again.

`encode` takes a bool, int, float or str, None, an enum, a list or tuple, a dictionary, an array, a
dataclass or a named tuple, and a scene or a part of one. `decode` reads each by its annotation, the
only place where the type of a result is declared. In JSON

- NaN is null, and an infinity is a text, since JSON has no such numbers;
- an array is nested lists of its numbers; one that is complex or empty, which lists cannot
  represent, is its shape and a list of its real and, if it has some, of its imaginary parts;
- a scene, or a part of one, is ``{"type": the name of its class, field: value, ...}``, since only
  the file knows which class it is. All of its numbers are finite.

A class that a file names is looked up among those that are defined in the running program, and its
fields are filled in: nothing that a file names is imported, called or unpickled.
"""

import contextlib
import dataclasses
import enum
import functools
import inspect
import math
import reprlib
import types
import typing
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import formulations
from jaxdyn._checks import fail
from jaxdyn._records import Record, captures_of_record
from jaxdyn.formulations.attitude import Attitude
from jaxdyn.formulations.mechanism import Mechanism
from jaxdyn.geometry.inertia import MaterialPoints
from jaxdyn.scene import Effect, Scene, System
from jaxdyn.scenes.catalogue import families
from jaxdyn.scenes.drawings import Angles
from jaxdyn.sketch import Looks
from jaxdyn.vibration.inputs import Input
from jaxdyn.vibration.signals import Signal

T = TypeVar("T")

MAX_NUMBERS = 10_000_000  # most numbers of one array
MAX_DEPTH = 32  # deepest nesting of parts in parts
#: Base classes of the parts of a scene.
PARTS = (System, Effect, Mechanism, Attitude, MaterialPoints, Looks, Angles, Input, Signal)
_INFINITIES = ("inf", "-inf")
_ANOTHER = (
    "Import the module that defines the class; if another version wrote the file, make it again."
)


def encode(value: Any, without: tuple[str, ...] = ()) -> Any:
    """A value as JSON, for `decode`.

    Args:
      value: a value of the kinds above.
      without: fields of a dataclass that are left out.
    Raises:
      ValueError: it is of another kind, or a scene with a function or a number that is not finite.
    Example:
      >>> import numpy as np
      >>> encode({"a": (1.0, float("nan")), "b": np.eye(2)})
      {'a': [1.0, None], 'b': [[1.0, 0.0], [0.0, 1.0]]}
    """
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, np.ndarray | jax.Array):
        return _encode_array(np.asarray(value))
    if isinstance(value, eqx.Module):
        return _encode_part(value)
    if dataclasses.is_dataclass(value) or _is_named_tuple(value):
        names = [name for name in _field_names(type(value)) if name not in without]
        return {name: encode(getattr(value, name)) for name in names}
    if isinstance(value, dict):
        return {str(key): encode(x) for key, x in value.items()}
    if isinstance(value, tuple | list):
        return [encode(x) for x in value]
    if isinstance(value, float):
        return _encode_number(value)
    if value is None or isinstance(value, bool | int | str):
        return value
    raise _unencodable(value)


def _encode_number(x: float) -> float | str | None:
    if math.isinf(x):
        return "inf" if x > 0 else "-inf"
    return None if math.isnan(x) else float(x)


def _encode_array(x: np.ndarray) -> Any:
    if x.size and not np.iscomplexobj(x):
        if np.isfinite(x).all():
            return x.tolist()
        return np.array([*map(_encode_number, x.ravel())], dtype=object).reshape(x.shape).tolist()
    flat = x.ravel()
    parts = {"real": flat.real, "imag": flat.imag} if np.iscomplexobj(x) else {"real": flat}
    return {"shape": list(x.shape)} | {k: [*map(_encode_number, y)] for k, y in parts.items()}


def _encode_part(part: Any) -> dict[str, Any]:
    """A scene or a part of one as JSON."""
    fields = {name: getattr(part, name) for name in _field_names(type(part))}
    return {"type": type(part).__name__} | {k: _encode_field(x) for k, x in fields.items()}


def _encode_field(value: Any) -> Any:
    """A field of a part of a scene as JSON, which can be read if the part's class is known."""
    if isinstance(value, eqx.Module) or _is_named_tuple(value):
        return _encode_part(value)
    if isinstance(value, tuple | list):
        return [_encode_field(x) for x in value]
    if isinstance(value, float | np.ndarray | jax.Array) and not np.isfinite(value).all():
        raise fail("record", "finite numbers", repr(value))
    if value is None or isinstance(value, bool | int | float | str | np.ndarray | jax.Array):
        return encode(value)
    raise _unencodable(value)


def _unencodable(value: Any) -> ValueError:
    return fail(
        "record",
        "numbers, strings and modules",
        f"{type(value).__name__} {value!r}",
        "Files hold no functions; make a class in a module, with the function as its method.",
    )


def _is_named_tuple(value: Any) -> bool:
    """Whether a value is a named tuple."""
    return isinstance(value, tuple) and hasattr(value, "_fields")


def _field_names(cls: type) -> tuple[str, ...]:
    """The fields of a named tuple, or those of a dataclass that its constructor takes."""
    if issubclass(cls, tuple):
        return getattr(cls, "_fields", ())
    return tuple(field.name for field in dataclasses.fields(cls) if field.init)


def decode(value: Any, hint: Any, name: str, remedy: str, *, lines: bool = False) -> Any:
    """The value of an annotated type that a JSON value represents.

    Args:
      value: the JSON value, from a file.
      hint: a type of the kinds that `encode` takes, except parts of scenes (`decode_part`); `Any`
        or a bare ``dict`` for what is read later.
      name: name of the value, for the message.
      remedy: what to do if it is of another type, for the message.
      lines: whether texts may have several lines and other characters that are not printable.
    Raises:
      ValueError: it is of another type, or is a text that is not printable in one line.
    Example:
      >>> decode([1, None], list[float], "bars", "")
      [1.0, nan]
    """
    kinds, origin = typing.get_args(hint), typing.get_origin(hint)
    inner = functools.partial(decode, name=name, remedy=remedy, lines=lines)
    if hint is Any:
        return value
    if origin in (types.UnionType, typing.Union):
        if value is None and types.NoneType in kinds:
            return None
        *kinds, last = (kind for kind in kinds if kind is not types.NoneType)
        for kind in kinds:
            with contextlib.suppress(ValueError):
                return inner(value, kind)
        return inner(value, last)
    if hint is float:
        if _is_number(value):
            return _decode_number(value)
    elif hint is np.ndarray:
        return _decode_array(value, name, remedy)
    elif isinstance(hint, type) and issubclass(hint, enum.Enum):
        if isinstance(value, int | str) and value in [member.value for member in hint]:
            return hint(value)
    elif origin is dict:
        if isinstance(value, dict):
            of_keys, of_values = kinds
            return {inner(key, of_keys): inner(x, of_values) for key, x in value.items()}
    elif hint in (bool, int, str, dict):
        if type(value) is hint and (hint is not str or lines or value.isprintable()):
            return value
    elif origin in (tuple, list):
        if isinstance(value, list):
            several = kinds[:1] * len(value) if kinds[-1] is ... or len(kinds) < 2 else kinds
            if len(several) == len(value):
                pairs = zip(value, several, strict=True)
                return origin(inner(x, kind) for x, kind in pairs)
    elif hint is tuple:  # a tuple of any plain values
        if isinstance(value, list):
            nested = int | float | str
            return tuple(inner(x, tuple if isinstance(x, list) else nested) for x in value)
    elif isinstance(value, dict) and isinstance(hint, type):
        return hint(**decode_fields(value, hint, name, remedy))
    raise fail(name, str(hint) if kinds else hint.__name__, reprlib.repr(value), remedy)


def decode_fields(
    value: Any,
    cls: Any,
    name: str,
    remedy: str,
    without: tuple[str, ...] = (),
    raw: tuple[str, ...] = (),
) -> dict[str, Any]:
    """The values of the fields of a dataclass or a named tuple, from an object of JSON.

    A field with a default may be missing: the class has gained it since the file was written.

    Args:
      value: the object, from a file.
      cls: the class.
      name: see `decode`.
      remedy: see `decode`.
      without: fields that the object does not have.
      raw: fields that stay JSON, since the object has only a part of what they hold.
    Returns: the values of the entries that the object has.
    Raises:
      ValueError: it is not an object, lacks an entry without a default, has other entries, or has
        one of another type.
    """
    hints = typing.get_type_hints(cls) | dict.fromkeys(raw, Any)
    names = {*_field_names(cls)} - {*without}
    needed = names - _optional_fields(cls)
    if not isinstance(value, dict) or not needed <= value.keys() <= names:
        got = type(value).__name__
        if isinstance(value, dict):
            got = sorted((needed - value.keys()) | (value.keys() - names))
        raise fail(name, f"the entries of {cls.__name__}", f"missing or extra {got}"[:80], remedy)
    return {key: decode(x, hints[key], f"{name}.{key}", remedy) for key, x in value.items()}


def _is_number(value: Any) -> bool:
    return value is None or type(value) in (int, float) or value in _INFINITIES


def _decode_number(value: Any) -> float:
    return math.nan if value is None else float(value)


def _decode_array(value: Any, name: str, remedy: str = "") -> np.ndarray:
    if isinstance(value, dict):
        return _decode_shaped(value, name, remedy)
    try:
        found = np.array(value, dtype=object)  # rows of several lengths stay lists, or are refused
        if not all(map(_is_number, found.ravel())):
            raise ValueError("other entries")
        numbers = np.array([*map(_decode_number, found.ravel())], dtype=float)
    except (ValueError, OverflowError) as error:
        raise fail(name, "an array of numbers", reprlib.repr(value), remedy) from error
    return _check_array(numbers, found.shape, name, remedy)


def _decode_shaped(value: dict, name: str, remedy: str) -> np.ndarray:
    """An array that is complex or empty; in older files any array of a result."""
    keys = value.keys()
    if keys not in ({"shape", "real"}, {"shape", "real", "imag"}):
        raise fail(name, "the shape and the numbers of an array", reprlib.repr(value), remedy)
    shape = decode(value["shape"], tuple[int, ...], f"{name}.shape", remedy)
    real, *imaginary = (
        np.array(decode(value[key], list[float], name, remedy), dtype=float)
        for key in ("real", "imag")
        if key in keys
    )
    real = _check_array(real, shape, name, remedy)
    if not imaginary:
        return real
    found = real.astype(complex)
    found.imag = _check_array(
        imaginary[0], shape, name, remedy
    )  # a sum would lose the signs of zeros
    return found


def _check_array(numbers: np.ndarray, shape: tuple[int, ...], name: str, remedy: str) -> np.ndarray:
    if numbers.size > MAX_NUMBERS:
        raise fail(name, f"at most {MAX_NUMBERS} numbers", numbers.size)
    if min(shape, default=0) < 0 or math.prod(shape) != numbers.size:
        raise fail(name, "as many numbers as its shape", shape, remedy)
    return numbers.reshape(shape)


# ---- Scenes, and the numbers of those that hold functions


class SceneNumbers(NamedTuple):
    """The part of a scene with functions that a file keeps: all its numbers, but no function.

    Attributes:
      name: name of the scene.
      entries: names of the entries of its state.
      numbers: its leaves, in the order of `jax.tree.leaves`.
      rates: (2, k) its rate at the start and at another state, by which its functions are
        recognised.
    """

    name: str
    entries: list[str]
    numbers: list[np.ndarray]
    rates: np.ndarray


def encode_scene(scene: Scene) -> dict[str, Any]:
    """A scene as JSON, for `decode_scene`; of one that holds a function, its numbers.

    Raises:
      ValueError: a number is not finite.
    """
    if _is_of_parts(scene):
        return _encode_part(scene)
    numbers = [np.asarray(x) for x in jax.tree.leaves(scene)]
    for x in numbers:
        if x.dtype.kind not in "biuf":
            raise _unencodable(x)
        if not np.isfinite(x).all():
            raise fail("record", "finite numbers", repr(x))
    entries = [name for name, _ in scene.labels()]
    # Rounded, since files are compared and the last digits differ between machines.
    rates = np.vectorize(lambda x: float(f"{x:.10e}"), otypes=[float])(_probe(scene))
    return encode(SceneNumbers(scene.name, entries, numbers, rates))


def decode_scene(value: Any, remedy: str, given: Scene | None = None) -> Scene:
    """The scene that an object of JSON describes, checked to have a rate.

    Args:
      value: the object, from a file.
      remedy: what to do if it is not a scene, for the message.
      given: a scene with the functions of the file's, if these are not in the file; its numbers are
        replaced by those of the file.
    Raises:
      ValueError: it does not describe a scene, names an unknown class, or has invalid numbers; or
        it needs a scene that is not given, or is another one.
    """
    if isinstance(value, dict) and "numbers" in value:
        known = SceneNumbers(**decode_fields(value, SceneNumbers, "scene", remedy))
        scene = _with_numbers(known, given)
    else:
        scene = decode_part(value, Scene, "scene", remedy=remedy)
    if not scene.name.isprintable():
        raise fail("name", "a printable text", repr(scene.name)[:40], remedy)
    if np.shape(scene.t1):
        raise fail("t1", "one number", f"shape {np.shape(scene.t1)}", remedy)
    scene.check()
    rate = scene.rate(jnp.zeros(()), scene.y0)
    if rate.shape != scene.y0.shape:
        raise fail("scene", f"a rate of shape {scene.y0.shape}", f"shape {rate.shape}", remedy)
    return scene


def _with_numbers(known: SceneNumbers, given: Scene | None) -> Scene:
    """A given scene with the numbers of a file, if it has the same equations."""
    title = known.name or "of the file"
    if given is None:
        remedy = "Pass it as scene=: files hold no functions."
        raise fail("scene", f"the scene {title}, with any values of its numbers", "none", remedy)
    leaves, tree = jax.tree.flatten(given)
    entries = [name for name, _ in given.labels()]
    shapes, wanted = [[np.shape(x) for x in each] for each in (leaves, known.numbers)]
    if entries != known.entries or shapes != wanted:
        expected = f"one with the entries {', '.join(known.entries)} and the numbers of the file"
        got = f"{', '.join(entries)}, with numbers of shapes {shapes} in place of {wanted}"
        raise fail("scene", expected, got)
    pairs = zip(known.numbers, leaves, strict=True)
    numbers = [jnp.asarray(x, jnp.asarray(leaf).dtype) for x, leaf in pairs]
    scene = jax.tree.unflatten(tree, numbers)
    rates, size = _probe(scene), np.abs(known.rates).max(initial=0.0, where=~np.isnan(known.rates))
    if rates.shape != known.rates.shape or not np.allclose(
        rates, known.rates, rtol=_SAME_RATE, atol=_SAME_RATE * size, equal_nan=True
    ):
        remedy = "Numbers that its function captures are not in the file: make it with the same."
        raise fail("scene", f"the equations of {title}", "others", remedy)
    return scene


#: Largest difference of rates of the same equations, relative to their size.
_SAME_RATE = 1e-9


def _probe(scene: Scene) -> np.ndarray:
    """(2, k) the rate at the start and at another state and time; NaN where it has no value."""
    y, t = np.asarray(scene.y0), float(np.ravel(scene.t1)[0])
    aside = y + 0.1 * (np.abs(y) + np.max(np.abs(y), initial=0.0)) * np.cos(np.arange(len(y)))
    states = (0.0, y), (0.3 * t, aside)
    return np.stack([np.asarray(scene.rate(jnp.asarray(t), jnp.asarray(y))) for t, y in states])


def _is_of_parts(value: Any) -> bool:
    """Whether all parts of a scene can be written: they consist of numbers and texts."""
    if isinstance(value, eqx.Module) or _is_named_tuple(value):
        return all(_is_of_parts(getattr(value, name)) for name in _field_names(type(value)))
    if isinstance(value, tuple | list):
        return all(map(_is_of_parts, value))
    return value is None or isinstance(value, bool | int | float | str | np.ndarray | jax.Array)


def decode_part(
    value: Any, cls: type[T], name: str, parts: tuple[type, ...] = PARTS, remedy: str = _ANOTHER
) -> T:
    """The scene, or the part of one, that an object of JSON describes and whose class it names.

    Args:
      value: the object, from a file.
      cls: the class of which it must be an instance.
      name: name of the value, for the message.
      parts: base classes of the parts that it may contain.
      remedy: what to do if it is something else, for the message.
    Raises:
      ValueError: it names an unknown class, lacks a field or has an extra one, or holds something
        that is not a number.
    """
    found = value
    if isinstance(value, dict):
        found = _decode_object(value, name, _known_classes((cls, *parts)))
    if not isinstance(found, cls):
        raise fail(name, f"a {cls.__name__}", type(found).__name__, remedy)
    return found


#: Classes that have other names in older files.
_RENAMED = {"Bodies": "FreeBars", "Bobs": "PointMasses"}


def _known_classes(kinds: tuple[type, ...]) -> dict[str, type]:
    """All concrete classes that a file may name: the loaded subclasses of these kinds."""
    families()  # load those of the ready-made scenes
    for name in formulations.__all__:
        getattr(formulations, name)  # and those of equations of one's own
    found: dict[str, type] = {}
    waiting = list(kinds)
    while waiting:
        cls = waiting.pop()
        waiting += cls.__subclasses__()
        if not inspect.isabstract(cls):
            found[cls.__name__] = cls
    return found


def _decode_object(value: dict[str, Any], name: str, classes: dict[str, type]) -> Any:
    if name.count(".") > MAX_DEPTH:
        raise fail(name[:20] + "...", f"at most {MAX_DEPTH} modules in each other", "more")
    called = value.get("type")
    cls = classes.get(_RENAMED.get(called, called)) if isinstance(called, str) else None
    if cls is None:
        raise fail(name, "the name of a class that is imported", reprlib.repr(called), _ANOTHER)
    names = {*_field_names(cls)}
    value = _default_values(cls) | value
    if names != value.keys() - {"type"}:
        wrong = sorted(names ^ (value.keys() - {"type"}))
        raise fail(name, f"the fields of {cls.__name__}", f"missing or extra {wrong}", _ANOTHER)
    if issubclass(cls, tuple):
        return cls(**{key: _decode_field(value[key], f"{name}.{key}", classes) for key in names})
    # The constructor is not called, since its arguments may differ from the fields.
    part, hints = object.__new__(cls), typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        if field.init:
            item, place = value[field.name], f"{name}.{field.name}"
            if field.metadata.get("static", False):
                item = _decode_static(item, hints[field.name], place)
            else:
                item = _decode_field(item, place, classes)
            object.__setattr__(part, field.name, item)
    if isinstance(part, Record):
        object.__setattr__(part, "captured", captures_of_record(part))
    return part


def _default_values(cls: type) -> dict[str, Any]:
    """The default values of fields, for those that a class has gained since a file was written."""
    fields = () if issubclass(cls, tuple) else dataclasses.fields(cls)
    return {f.name: _encode_field(f.default) for f in fields if f.name in _optional_fields(cls)}


def _optional_fields(cls: type) -> set[str]:
    """The fields that have a default value, which an older file may lack."""
    if issubclass(cls, tuple):
        return set()
    fields = dataclasses.fields(cls)
    return {f.name for f in fields if f.init and f.default is not dataclasses.MISSING}


def _decode_field(item: Any, name: str, classes: dict[str, type]) -> Any:
    """The value of a traced field of a part: numbers, parts, tuples of them, or None."""
    if isinstance(item, dict) and "shape" not in item:
        return _decode_object(item, name, classes)
    if item == [] or (isinstance(item, list) and any(isinstance(x, dict) for x in item)):
        return tuple(_decode_field(x, name, classes) for x in item)
    if item is None or isinstance(item, bool):
        return item
    numbers = _decode_array(item, name)
    if not np.isfinite(numbers).all():
        bad = numbers[~np.isfinite(numbers)][0]
        raise fail(name, "finite numbers", bad)
    return jnp.asarray(numbers)


def _decode_static(item: Any, hint: Any, name: str) -> Any:
    """The value of a static field: plain data, which are constants of compiled programs."""
    if isinstance(item, dict) or hint is Any:
        raise fail(name, "numbers and texts", reprlib.repr(item))
    found = decode(item, hint, name, "", lines=True)  # such as the text of a model
    if not all(math.isfinite(x) for x in jax.tree.leaves(found) if isinstance(x, float)):
        raise fail(name, "finite numbers", reprlib.repr(item))
    return found
