"""Files that grow by a line of JSON at a time, so that an interrupted run loses nothing.

Each line is on the disk when `Journal.add` returns, and ends with a digest of the rest: an
incomplete last line is ignored, and a file that was edited is refused.
"""

import json
import os
from pathlib import Path
from typing import Any

from jaxdyn.files.input_files import content, parsed
from jaxdyn.files.output_files import append, replace, unwritable, writable
from jaxdyn.files.records import digest

MAX_BYTES = 2**30  # larger files are refused


class NotAJournal(ValueError):
    """Raised where a file has lines that a journal does not have."""


class Journal:
    """A file of records, to which more are added.

    Attributes:
      records: those that the file has, its first line among them.
    """

    def __init__(self, path: str | Path, header: dict[str, Any], remedy: str):
        """Begin a file with a header, or open the one that is there.

        Args:
          path: of the file.
          header: its first record.
          remedy: what to do where the file cannot be read, for the message.
        Raises:
          NotAJournal: it is another file, or was edited.
          ValueError: it cannot be written.
        """
        self._path = writable(path)
        lines = whole_lines(self._path, remedy)
        if lines:
            self.records = records(lines)
            os.truncate(self._path, len(lines))
            return
        first = line(header)
        if self._path.exists() and not first.encode().startswith(self._path.read_bytes()):
            raise NotAJournal("no whole line")
        self.records = [json.loads(json.dumps(header))]
        replace(self._path, first)

    def add(self, record: dict[str, Any]) -> None:
        """Add a record; it is on the disk when this returns."""
        try:
            append(self._path, line(record))
        except OSError as error:
            raise unwritable(self._path, error) from error


def whole_lines(path: Path, remedy: str) -> bytes:
    """The content of a file up to its last line break; nothing where there is no file."""
    data = content(path, MAX_BYTES, remedy) if path.exists() else b""
    return data[: data.rfind(b"\n") + 1]


def line(record: dict[str, Any]) -> str:
    """A record as a line with a digest."""
    return json.dumps({**record, "digest": digest(record)}, allow_nan=False) + "\n"


def records(data: bytes) -> list[dict[str, Any]]:
    """The records of lines, without their digests.

    Raises:
      NotAJournal: a line is no object of JSON with finite numbers, or its digest is another.
    """
    try:
        return [_record(each) for each in data.splitlines()]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise NotAJournal(str(error)) from error


def _record(each: bytes) -> dict[str, Any]:
    record = parsed(each, "a line of another type")
    if record.pop("digest") != digest(record):
        raise KeyError("digest")
    return record
