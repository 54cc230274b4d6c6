"""Digests at the ends of files: every byte that changed, is missing or was added is noticed.

The digest is that of all other bytes of a file, or of a line of one, not of what they mean: of
``1e-13`` and ``1E-13``, which are one number, one is damaged. It detects damage and edits that
were not meant, not forgery: anyone can compute a new one. Nothing here loads JAX.
"""

import hashlib
import json
import re
from typing import Any

from jaxdyn._text import fail
from jaxdyn.files.input_files import check_values

DAMAGED = "The file was edited or damaged, or another version wrote it: make it again."
DIGITS = 32
#: At the end of an object of JSON, or of a comment.
_AT_END = re.compile(rb'digest"?: "?([0-9a-f]{%d})"?\n?\}?\n?\Z' % DIGITS)
_LONGEST = DIGITS + 20  # bytes that this matches


def json_text(record: dict[str, Any], indent: int | None = None) -> bytes:
    """An object of JSON as text, its digest as its last entry, with a line break at its end.

    Args:
      record: without an entry "digest".
      indent: of each level; all is on one line by default.
    Raises:
      ValueError: see `plain_text`.
    """
    text = plain_text({**record, "digest": ""}, indent)
    return with_digest(text + b"\n", text.rindex(b'"'))


def plain_text(record: Any, indent: int | None = None) -> bytes:
    """A value as text of JSON.

    Raises:
      ValueError: it has numbers that are not finite, or more values than `parse_json` takes.
    """
    try:
        text = json.dumps(record, indent=indent, allow_nan=False).encode()
    except ValueError as error:
        raise fail("record", "finite numbers", f"others ({error})") from error
    check_values(text, "record", "Save less in one file.")
    return text


def with_digest(data: bytes, at: int) -> bytes:
    """Data with their digest inserted at a place; "digest: " stands before it."""
    return data[:at] + _digest(data) + data[at:]


def has_digest(data: bytes, name: str = "file", remedy: str = DAMAGED) -> bool:
    """Whether data have a digest at their end.

    Args:
      data: all bytes of a file, or of a line of one.
      name: of the argument or option, for the message.
      remedy: what to do where they are damaged, for the message.
    Raises:
      ValueError: they have one, and it is that of other data.
    """
    found = _AT_END.search(data, max(len(data) - _LONGEST, 0))
    if found is None:
        return False
    start, end = found.span(1)
    if _digest(data[:start] + data[end:]) != found[1]:
        raise fail(name, "data that match its digest", "other data", remedy)
    return True


def digest_of_values(record: dict[str, Any]) -> str:
    """The digest that older files have: of the values of a record, without that entry."""
    text = json.dumps(record, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).hexdigest()[:DIGITS].encode()
