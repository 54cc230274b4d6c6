"""Reading of files of limited size, as JSON with finite numbers; nothing here loads JAX."""

import json
import math
from pathlib import Path
from typing import Any

from jaxdyn._text import fail

MAX_BYTES = 64 * 2**20  # a larger file is not one of these records
#: Most values of one JSON text: in Python each takes up to 72 bytes, however short its text is.
MAX_VALUES = 4_000_000
_DIGITS = 18


def as_path(path: str | Path, name: str = "path") -> Path:
    """The path as an object of `pathlib`.

    Raises:
      ValueError: `path` is neither a string nor a path.
    """
    try:
        return Path(path)
    except TypeError as error:
        raise fail(name, "the path of a file", repr(path)) from error


def content(path: str | Path, most: int, remedy: str = "", name: str = "file") -> bytes:
    """The content of a file of at most `most` bytes.

    Args:
      path: path of the file.
      most: largest number of bytes.
      remedy: what to do if it cannot be read, for the message.
      name: name of the argument or option, for the message.

    Raises:
      ValueError: `path` is not a readable file, is larger, or is a device or a pipe, which may
          have no end.
    """
    path = as_path(path, name)
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise fail(name, "a file on a disk", f"{path}, a device or a pipe", remedy)
        with open(path, "rb") as file:
            data = file.read(most + 1)
    except OSError as error:
        raise fail(name, "a readable file", f"{path} ({error.strerror})", remedy) from error
    if len(data) > most:
        raise fail(name, f"at most {most} bytes", "more", remedy)
    return data


def parse_json(data: bytes, what: str, remedy: str = "") -> Any:
    """The value of JSON text that has only finite numbers, and integers that floats can hold.

    Raises:
      ValueError: the text is anything else, or has more than `MAX_VALUES` values, which are counted
        before it is parsed.
    """
    check_values(data, "file", remedy)
    kinds = {"parse_constant": _no_constant, "parse_int": _integer, "parse_float": _float}
    try:
        return json.loads(data.decode(), **kinds)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise fail("file", "JSON", f"{what} ({error})", remedy) from error


def check_values(data: bytes, name: str, remedy: str) -> None:
    """Refuse JSON text of more than `MAX_VALUES` values, without parsing it."""
    # Each value except the first follows one of these characters.
    count = sum(map(data.count, (b",", b"[", b"{", b":")))
    if count > MAX_VALUES:
        wanted = f"at most {MAX_VALUES} numbers, texts and lists"
        raise fail(name, wanted, f"some {count}", remedy)


def _no_constant(name: str):
    raise fail("file", "finite numbers", name, "The file was edited or is damaged.")


def _integer(text: str) -> int:
    # Floats cannot hold larger integers, and Python takes quadratic time for very long ones.
    if len(text) > _DIGITS:
        raise fail("file", f"integers of at most {_DIGITS} digits", f"one of {len(text)}")
    return int(text)


def _float(text: str) -> float:
    number = float(text)
    if math.isinf(number):
        _no_constant(text[:_DIGITS])
    return number
