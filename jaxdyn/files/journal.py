"""Files that grow by a line of JSON at a time, so that an interrupted run loses nothing.

Each line is on the disk when `Journal.add` returns, and ends with a digest of the rest: a file that
was edited is refused, and an incomplete last line is ignored. A lock beside the file is held while
a line is added, so that several programs may add lines in turn, and by `Journal.alone`.
"""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import filelock

from jaxdyn._text import fail
from jaxdyn.files.digests import digest_of_values, has_digest, json_text
from jaxdyn.files.input_files import content, parsed
from jaxdyn.files.output_files import append, replace, target_of, unwritable, writable

MAX_BYTES = 2**30  # larger files are refused
_BEGIN = b'{"'  # of each line


class NotAJournal(ValueError):
    """Raised where a file has lines that a journal does not have."""


class Journal:
    """A file of records, to which more are added.

    Attributes:
      records: those that the file had when it was opened, its first line among them.
    """

    def __init__(self, path: str | Path, header: dict[str, Any], remedy: str, patience: float):
        """Begin a file with a header, or open the one that is there.

        Args:
          path: of the file.
          header: its first record.
          remedy: what to do where the file cannot be read, for the message.
          patience: how long to wait for other programs that write the file [s].
        Raises:
          NotAJournal: it is another file, or was edited.
          ValueError: it cannot be written, or another program writes it.
        """
        self._path = writable(path)
        # Held by all threads of this program, since reports may come from any.
        lock = _lock_of(self._path)
        self._lock = filelock.FileLock(lock, timeout=patience, thread_local=False)
        with self._hold_lock():
            self.records, self._size = self._open(json_text(header), remedy)

    def _open(self, first: bytes, remedy: str) -> tuple[list[dict[str, Any]], int]:
        """The records of the file, which begins with this line if it is new, and its size."""
        lines = whole_lines(self._path, remedy)
        try:
            if lines:
                os.truncate(self._path, len(lines))
            elif self._path.exists() and not first.startswith(self._path.read_bytes()):
                raise NotAJournal("no whole line")
            else:
                replace(self._path, first)
        except OSError as error:
            raise unwritable(self._path, error) from error
        lines = lines or first
        return records(lines), len(lines)

    def add(self, record: dict[str, Any]) -> None:
        """Add a record; it is on the disk when this returns."""
        data = json_text(record)
        with self._hold_lock():
            try:
                append(self._path, data)
            except OSError as error:
                raise unwritable(self._path, error) from error
        self._size += len(data)

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Let no other program write the file; may be nested.

        Raises:
          ValueError: another one writes it, or has written it since it was opened.
        """
        with self._hold_lock():
            if not self._path.exists() or self._path.stat().st_size != self._size:
                got = f"'{self._path}', which another one has changed"
                raise fail("path", "a file that only this program writes", got, "Run it again.")
            yield

    @contextlib.contextmanager
    def _hold_lock(self) -> Iterator[None]:
        try:
            self._lock.acquire()
        except filelock.Timeout as error:
            remedy = "Wait until it has ended, or give another path."
            got = f"'{self._path}', which another one writes now"
            raise fail("path", "a file that only this program writes", got, remedy) from error
        except OSError as error:
            raise unwritable(self._path, error) from error
        except NotImplementedError as error:  # so does filelock where there are no locks
            raise unwritable(
                self._path, OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))
            ) from error
        try:
            yield
        finally:
            self._lock.release()


def remove(path: Path) -> None:
    """Remove a file that is needed no more, and its lock."""
    path.unlink()
    _lock_of(path).unlink(missing_ok=True)


def _lock_of(path: Path) -> Path:
    """The lock of a file itself, whatever links lead to it."""
    target = target_of(path)
    return target.with_name(f"{target.name}.lock")


def whole_lines(path: Path, remedy: str) -> bytes:
    """The content of a file up to its last line break; nothing where there is no file.

    Raises:
      NotAJournal: what follows is not the beginning of a line.
    """
    data = content(path, MAX_BYTES, remedy) if path.exists() else b""
    size = data.rfind(b"\n") + 1
    # A file system may have made room for a line that a lost machine did not write.
    rest = data[size:].rstrip(b"\0")
    if size and not (rest.startswith(_BEGIN) or _BEGIN.startswith(rest)):
        raise NotAJournal("something after its last line")
    if _is_whole(data[size:-1]):
        raise NotAJournal("another byte for a line break")
    return data[:size]


def _is_whole(data: bytes) -> bool:
    """Whether data are a line without its break."""
    try:
        return has_digest(data + b"\n")
    except ValueError:
        return False


def records(data: bytes) -> list[dict[str, Any]]:
    """The records of lines, without their digests.

    Raises:
      NotAJournal: a line is no object of JSON with finite numbers, or its digest is another.
    """
    try:
        return [_record(each + b"\n") for each in data.removesuffix(b"\n").split(b"\n")]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise NotAJournal(str(error)) from error


def _record(line: bytes) -> dict[str, Any]:
    digested = has_digest(line)
    record = parsed(line, "a line of another type")
    claimed = record.pop("digest")
    # Older files have a digest of the values.
    if not digested and claimed != digest_of_values(record):
        raise KeyError("digest")
    return record
