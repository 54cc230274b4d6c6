"""Results as plain JSON, and back as the types that their annotations name.

A value is a bool, int, float or str, None, an enum, a list or tuple of one type, a tuple of
several, a dictionary, a real or complex array, a dataclass or a named tuple, or anything where
`Any` or a bare ``dict`` is expected. Null is NaN where a float is expected, and a text an infinity:
JSON has no others.
"""

import dataclasses
import enum
import math
import reprlib
import types
import typing
from typing import Any

import numpy as np

from jaxdyn._text import fail

_MOST = 10_000_000  # numbers of an array
_INFINITIES = ("inf", "-inf")


def plain(value: Any, without: tuple[str, ...] = ()) -> Any:
    """A value as JSON, for `typed`.

    Args:
      value: of the kinds above.
      without: fields of a dataclass that are left out.
    Example:
      >>> import numpy as np
      >>> plain({"a": (1.0, float("nan")), "b": np.array([[1j]])})
      {'a': [1.0, None], 'b': {'shape': [1, 1], 'real': [0.0], 'imag': [1.0]}}
    """
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, np.ndarray):
        flat = value.ravel()
        parts = {"real": flat.real, "imag": flat.imag} if np.iscomplexobj(flat) else {"real": flat}
        numbers = {name: [_number(float(x)) for x in part] for name, part in parts.items()}
        return {"shape": list(value.shape), **numbers}
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value) if field.name not in without]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {name: plain(x) for name, x in zip(value._fields, value, strict=True)}
    if isinstance(value, dict):
        return {str(key): plain(x) for key, x in value.items()}
    if isinstance(value, tuple | list):
        return [plain(x) for x in value]
    return _number(value) if isinstance(value, float) else value


def _number(x: float) -> float | str | None:
    if math.isinf(x):
        return _INFINITIES[x < 0]
    return None if math.isnan(x) else float(x)


def typed(value: Any, hint: Any, name: str, remedy: str) -> Any:
    """A value of JSON as its annotation says.

    Args:
      value: from a file.
      hint: a type of the kinds above.
      name: of the value, for the message.
      remedy: what to do where it is of another type, for the message.
    Raises:
      ValueError: it is of another type, or a text that is not printable in one line.
    Example:
      >>> typed([1, None], list[float], "bars", "")
      [1.0, nan]
    """
    kinds = typing.get_args(hint)
    if isinstance(hint, types.UnionType):
        inner = next(kind for kind in kinds if kind is not types.NoneType)
        return None if value is None else typed(value, inner, name, remedy)
    if hint is Any:
        return value
    if hint is float:
        if value is None or type(value) in (int, float) or value in _INFINITIES:
            return math.nan if value is None else float(value)
    elif hint is np.ndarray:
        return _array(value, name, remedy)
    elif isinstance(hint, type) and issubclass(hint, enum.Enum):
        if isinstance(value, int | str) and value in [member.value for member in hint]:
            return hint(value)
    elif typing.get_origin(hint) is dict:
        if isinstance(value, dict):
            pairs = value.items()
            return {
                typed(k, kinds[0], name, remedy): typed(x, kinds[1], name, remedy) for k, x in pairs
            }
    elif hint in (bool, int, str, dict):
        if type(value) is hint and (hint is not str or value.isprintable()):
            return value
    elif isinstance(value, list) and kinds:
        several = kinds[:1] * len(value) if kinds[-1] is ... or len(kinds) < 2 else kinds
        if len(several) == len(value):
            pairs = zip(value, several, strict=True)
            origin: Any = typing.get_origin(hint)
            return origin(typed(x, kind, name, remedy) for x, kind in pairs)
    elif isinstance(value, dict) and not kinds:
        return hint(**typed_fields(value, hint, name, remedy))
    raise fail(name, str(hint) if kinds else hint.__name__, reprlib.repr(value), remedy)


def _array(value: Any, name: str, remedy: str) -> np.ndarray:
    """The array of what `plain` makes of one."""
    keys = value.keys() if isinstance(value, dict) else set()
    if keys not in ({"shape", "real"}, {"shape", "real", "imag"}):
        raise fail(name, "the shape and the numbers of an array", reprlib.repr(value), remedy)
    shape = typed(value["shape"], tuple[int, ...], f"{name}.shape", remedy)
    parts = [
        typed(value[key], list[float], name, remedy) for key in ("real", "imag") if key in keys
    ]
    size = math.prod(shape)
    if min(shape, default=0) < 0 or size > _MOST or any(len(part) != size for part in parts):
        raise fail(name, f"as many numbers as its shape, at most {_MOST}", shape, remedy)
    real, *imaginary = (np.array(part, dtype=float).reshape(shape) for part in parts)
    if not imaginary:
        return real
    found = real.astype(complex)
    found.imag = imaginary[0]  # a sum would lose the signs of zeros
    return found


def typed_fields(
    value: Any, cls: Any, name: str, remedy: str, without: tuple[str, ...] = ()
) -> dict[str, Any]:
    """The values of the fields of a dataclass or a named tuple, from an object of JSON.

    Args:
      value: from a file.
      cls: the class.
      name: see `typed`.
      remedy: see `typed`.
      without: fields that the object does not have.
    Raises:
      ValueError: it is no object, has other entries, or one of another type.
    """
    hints = typing.get_type_hints(cls)
    declared = dataclasses.fields(cls) if dataclasses.is_dataclass(cls) else ()
    names = getattr(cls, "_fields", tuple(field.name for field in declared))
    wanted = [key for key in names if key not in without]
    if not isinstance(value, dict) or value.keys() != {*wanted}:
        got = sorted({*wanted} ^ value.keys()) if isinstance(value, dict) else type(value).__name__
        raise fail(name, f"the entries of {cls.__name__}", f"missing or extra {got}"[:80], remedy)
    return {key: typed(value[key], hints[key], f"{name}.{key}", remedy) for key in wanted}
