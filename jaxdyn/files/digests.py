"""Digests at the ends of files, by which every changed, missing or added byte is noticed.

The digest is that of all other bytes of a file, or of a line of one, not of their meaning: where
``1e-13`` was written, ``1E-13`` is damage, though both are one number. It detects damage and
inadvertent edits, not forgery: anyone can compute a new digest. Nothing here loads JAX.
"""

import hashlib
import json
import re
from typing import Any

from jaxdyn._text import fail
from jaxdyn.files.input_files import check_values

DAMAGED = "The file was edited or damaged, or another version wrote it: make it again."
DIGITS = 32
#: The digest at the end of an object of JSON, or of a comment.
_AT_END = re.compile(rb'digest"?: "?([0-9a-f]{%d})"?\n?\}?\n?\Z' % DIGITS)
_LONGEST = DIGITS + 20  # most bytes that this matches


def json_text(record: dict[str, Any], indent: int | None = None) -> bytes:
    """An object of JSON as text, with its digest as the last entry, and a line break at the end.

    Args:
      record: the object, without an entry "digest".
      indent: indentation of each level; by default all is on one line.
    Raises:
      ValueError: see `plain_text`.
    """
    text = plain_text({**record, "digest": ""}, indent)
    return with_digest(text + b"\n", text.rindex(b'"'))


def plain_text(record: Any, indent: int | None) -> bytes:
    """A value as JSON text.

    Raises:
      ValueError: it has numbers that are not finite, or more values than `parse_json` accepts.
    """
    try:
        text = json.dumps(record, indent=indent, allow_nan=False).encode()
    except ValueError as error:
        raise fail("record", "finite numbers", f"others ({error})") from error
    check_values(text, "record", "Save less in one file.")
    return text


def with_digest(data: bytes, at: int) -> bytes:
    """Data with their digest inserted at a position, which follows the text "digest: "."""
    return data[:at] + _digest(data) + data[at:]


def has_digest(data: bytes, name: str = "file", remedy: str = DAMAGED) -> bool:
    """Whether data have a digest at their end.

    Args:
      data: all bytes of a file, or of a line of one.
      name: name of the argument or option, for the message.
      remedy: what to do if they are damaged, for the message.
    Raises:
      ValueError: they have a digest that does not match them.
    """
    found = _AT_END.search(data, max(len(data) - _LONGEST, 0))
    if found is None:
        return False
    start, end = found.span(1)
    if _digest(data[:start] + data[end:]) != found[1]:
        raise fail(name, "data that match its digest", "other data", remedy)
    return True


def digest_of_values(record: dict[str, Any]) -> str:
    """The digest of older files, computed from the values of a record without this entry."""
    text = json.dumps(record, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).hexdigest()[:DIGITS].encode()
