"""Scenes as plain JSON, and back, without executing anything from a file.

A module or named tuple becomes ``{"type": its class name, field: value, ...}``; arrays become
nested lists of numbers. Reading looks the class up among those that are defined in the running
program and fills in its fields; it never imports, calls or unpickles what a file names.
"""

import dataclasses
import inspect
import math
import reprlib
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import fail
from jaxdyn._records.captured import captures_of_record
from jaxdyn._records.record import Record
from jaxdyn.files import digests
from jaxdyn.files.input_files import MAX_BYTES, content, parsed
from jaxdyn.files.output_files import replace, unwritable, writable
from jaxdyn.scene import Effect, Scene, System

MAX_NUMBERS = 1_000_000  # of one array
MAX_DEPTH = 32  # of modules in modules
_ANOTHER = (
    "Import the module that defines the class; if another version wrote the file, make it again."
)


def encode(value: Any) -> Any:
    """A scene, system, effect or closing as numbers, strings, lists and dictionaries."""
    if isinstance(value, eqx.Module):
        fields = {f.name: encode(getattr(value, f.name)) for f in _fields(type(value))}
        return {"type": type(value).__name__, **fields}
    if isinstance(value, tuple) and _fields_of_tuple(type(value)):
        return {
            "type": type(value).__name__,
            **{f: encode(getattr(value, f)) for f in _fields_of_tuple(type(value))},
        }
    if isinstance(value, Array | np.ndarray):
        return np.asarray(value).tolist()
    if isinstance(value, tuple | list):
        return [encode(item) for item in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise fail(
        "record",
        "numbers, strings and modules",
        f"{type(value).__name__} {value!r}",
        "A scene that holds a function cannot be written to a file; make a class of it in a "
        "module: a System with the function as its method `rate`, or an Effect.",
    )


def decode(value: Any, what: str = "record", kinds: tuple[type, ...] = (System, Effect)) -> Any:
    """What `encode` was given; arrays as float arrays, lists of modules as tuples.

    Args:
      value: part of a record.
      what: its name in messages.
      kinds: base classes of the classes that it may name, besides scenes.
    Raises:
      ValueError: `value` names an unknown class, lacks a field or has an extra one, or holds
          something that is not a number.
    """
    if what.count(".") > MAX_DEPTH:
        raise fail(what[:20] + "...", f"at most {MAX_DEPTH} modules in each other", "more")
    if isinstance(value, dict):
        return _module(value, what, kinds)
    if isinstance(value, list):
        if any(isinstance(item, dict) for item in value):
            return tuple(decode(item, what, kinds) for item in value)
        return _array(value, what)
    if isinstance(value, float):
        return _array(value, what)
    return value


def write(path: str | Path, record: dict[str, Any]) -> None:
    """Write a record to a JSON file, atomically: a killed process leaves the old file.

    Its digest is its last entry.

    Raises:
      ValueError: `path` cannot be written, the record has numbers that are not finite, or the file
        would be larger than `read` takes.
    """
    path = writable(path, name="file")
    text = digests.json_text(record, indent=1)
    if len(text) > MAX_BYTES:
        raise fail("record", f"at most {MAX_BYTES} bytes", len(text), "Save less in one file.")
    try:
        replace(path, text)
    except OSError as error:
        raise unwritable(path, error, "file") from error


def read(
    path: str | Path, kind: str, version: int, older: Mapping[int, bool] | None = None
) -> dict[str, Any]:
    """The record in a JSON file that `write` wrote, without its digest.

    Args:
      path: of the file.
      kind: its format.
      version: its version.
      older: versions without a digest of all bytes, which are read too, and whether their files
        have one of the values.
    Raises:
      ValueError: it is a file of another kind or version, or a byte of it changed.
    """
    remedy = f"Give the path of a file that this program wrote as a {kind}."
    data = content(path, MAX_BYTES, remedy)
    digested = digests.has_digest(data)
    record = parsed(data, str(path), remedy)
    if not isinstance(record, dict) or record.get("format") != kind:
        got = record.get("format") if isinstance(record, dict) else type(record).__name__
        raise fail("file", f"format {kind!r}", repr(got), remedy)
    older = older or {}
    if record.get("version") not in (version, *older):
        raise fail(
            "file", f"version {version}", repr(record.get("version")), "Make the file again."
        )
    claimed = record.pop("digest", None)
    if digested:
        return record
    if record["version"] not in older:
        raise fail("file", "a digest at its end", "none", digests.DAMAGED)
    if claimed != (digests.digest_of_values(record) if older[record["version"]] else None):
        raise fail("file", "data that match its digest", "other data", digests.DAMAGED)
    return record


def _classes(kinds: tuple[type, ...]) -> dict[str, type]:
    """All concrete classes that a record may name: scenes, and loaded ones of these kinds."""
    found: dict[str, type] = {"Scene": Scene}
    waiting = list(kinds)
    while waiting:
        cls = waiting.pop()
        waiting += cls.__subclasses__()
        if not inspect.isabstract(cls):
            found[cls.__name__] = cls
    return found


def _module(value: dict, what: str, kinds: tuple[type, ...]) -> Any:
    classes = _classes(kinds)
    name = value.get("type")
    cls = classes.get(name) if isinstance(name, str) else None
    if cls is None:
        raise fail(what, "the name of a class that is imported", reprlib.repr(name), _ANOTHER)
    value = _defaults(cls) | value
    names = {*_fields_of_tuple(cls)} or {f.name for f in _fields(cls)}
    if names != value.keys() - {"type"}:
        wrong = sorted(names ^ (value.keys() - {"type"}))
        raise fail(what, f"the fields of {cls.__name__}", f"missing or extra {wrong}", _ANOTHER)
    if _fields_of_tuple(cls):
        return cls(**{key: _number_or(value[key], f"{what}.{key}", kinds) for key in names})
    # Not by the constructor, whose arguments may differ from the fields.
    module, hints = object.__new__(cls), typing.get_type_hints(cls)
    for field in _fields(cls):
        item, place = value[field.name], f"{what}.{field.name}"
        if field.metadata.get("static", False):
            item = _static(item, hints[field.name], place)
        else:
            item = _number_or(item, place, kinds)
        object.__setattr__(module, field.name, item)
    if isinstance(module, Record):
        object.__setattr__(module, "captured", captures_of_record(module))
    return module


def _defaults(cls: type) -> dict[str, Any]:
    """Values of the fields that a class has gained since a file was written: their defaults."""
    if _fields_of_tuple(cls):
        return {}
    fields = [f for f in _fields(cls) if f.default is not dataclasses.MISSING]
    return {f.name: encode(f.default) for f in fields}


def _fields(cls: type) -> list[dataclasses.Field]:
    """The fields of a module without those that it computes when it is made."""
    return [field for field in dataclasses.fields(cls) if field.init]


def _fields_of_tuple(cls: type) -> tuple[str, ...]:
    """The fields of a class of named tuples; () for any other class."""
    return getattr(cls, "_fields", ()) if issubclass(cls, tuple) else ()


def _static(item: Any, hint: Any, what: str) -> Any:
    """The value of a static field, checked against the annotation in its class."""
    try:
        item = _tuples(item)
        fits = _fits(item, hint)
    except RecursionError:
        fits = False
    if not fits:
        raise fail(what, f"{getattr(hint, '__name__', hint)}", reprlib.repr(item))
    return item


def _tuples(item: Any) -> Any:
    """Nested lists as nested tuples: static fields must be hashable."""
    return tuple(map(_tuples, item)) if isinstance(item, list) else item


def _fits(item: Any, hint: Any) -> bool:
    """Whether an item is of a type made of bool, int, str, None, tuples and unions."""
    kinds = typing.get_args(hint)
    if isinstance(hint, types.UnionType):
        return any(_fits(item, kind) for kind in kinds)
    if not isinstance(item, tuple):
        return type(item) is hint
    if hint is tuple:
        return all(_fits(x, tuple | int | float | str) for x in item)
    if typing.get_origin(hint) is not tuple:
        return False
    if kinds[-1] is Ellipsis:
        kinds = kinds[:1] * len(item)
    return len(kinds) == len(item) and all(map(_fits, item, kinds))


def _number_or(item: Any, what: str, kinds: tuple[type, ...]) -> Any:
    if isinstance(item, int | float | str):  # no texts, nor truth values
        return _array(item, what)
    return () if item == [] else decode(item, what, kinds)


def _array(value: Any, what: str) -> Array:
    try:
        # Without a type: with one, NumPy makes numbers of texts.
        found = np.array(value)
        kinds = {*map(type, np.array(value, dtype=object).ravel().tolist())}
    except (TypeError, ValueError) as error:
        raise fail(what, "an array of numbers", reprlib.repr(value)) from error
    if not kinds <= {int, float} or found.dtype == object:
        raise fail(what, "an array of numbers", reprlib.repr(value))
    array = found.astype(float)
    if array.size > MAX_NUMBERS:
        raise fail(what, f"at most {MAX_NUMBERS} numbers", array.size)
    if not np.isfinite(array).all():
        bad = array[~np.isfinite(array)][0]
        raise fail(what, "finite numbers", math.nan if np.isnan(bad) else bad)
    return jnp.asarray(array)
