"""Files that are read: of a limited size, as JSON with finite numbers; nothing here loads JAX."""

import json
from pathlib import Path
from typing import Any

from jaxdyn._records.kinds import check_first
from jaxdyn._text import fail

MAX_BYTES = 64 * 2**20  # a larger file is not one of these records
_DIGITS = 18


def content(path: str | Path, most: int, remedy: str = "", name: str = "file") -> bytes:
    """The content of a file of at most `most` bytes.

    Args:
      path: of the file.
      most: bytes.
      remedy: what to do where it cannot be read, for the message.
      name: of the argument or option, for the message.

    Raises:
      ValueError: `path` is not a readable file, is larger, or is a device or a pipe, which may
          have no end.
    """
    path = Path(path)
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


@check_first
def parsed(data: bytes, what: str, remedy: str = "") -> Any:
    """The value of JSON text with finite numbers only, and integers that floats can hold.

    Raises:
      ValueError: the text is anything else.
    """
    try:
        return json.loads(data.decode(), parse_constant=_no_constant, parse_int=_integer)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise fail("file", "JSON", f"{what} ({error})", remedy) from error


def _no_constant(name: str):
    raise fail("file", "finite numbers", name, "The file was edited or is damaged.")


def _integer(text: str) -> int:
    # Floats cannot hold larger ones, and Python takes quadratic time for very long ones.
    if len(text) > _DIGITS:
        raise fail("file", f"integers of at most {_DIGITS} digits", f"one of {len(text)}")
    return int(text)
