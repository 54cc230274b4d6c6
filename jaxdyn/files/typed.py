"""Plain JSON as the types that annotations name: the inverse of `dataclasses.asdict`.

A value is a bool, int, float or str, None, a list or tuple of one type, a tuple of several, a
dataclass or a named tuple. Null is NaN where a float is expected: JSON has no other.
"""

import dataclasses
import math
import reprlib
import types
import typing
from typing import Any

from jaxdyn._text import fail


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
    if hint is float:
        if value is None or type(value) in (int, float):
            return math.nan if value is None else float(value)
    elif hint in (bool, int, str):
        if type(value) is hint and (hint is not str or value.isprintable()):
            return value
    elif isinstance(value, list) and kinds:
        several = kinds[:1] * len(value) if kinds[-1] is ... or len(kinds) < 2 else kinds
        if len(several) == len(value):
            pairs = zip(value, several, strict=True)
            return typing.get_origin(hint)(typed(x, kind, name, remedy) for x, kind in pairs)
    elif isinstance(value, dict) and not kinds:
        return hint(**typed_fields(value, hint, name, remedy))
    raise fail(name, str(hint) if kinds else hint.__name__, reprlib.repr(value), remedy)


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
