"""Files that grow by one line of JSON at a time, so that an interrupted run loses nothing.

Each line is on the disk when `Journal.add` returns, and ends with a digest of the rest: a file that
was edited is refused, and an incomplete last line is ignored. A lock beside the file is held while
a line is added, so that several programs may add lines in turn, and for the duration of
`Journal.alone`. The first line is the header of the file's `layout`.
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
from jaxdyn.files.input_files import as_path, content, parse_json
from jaxdyn.files.layout import Layout
from jaxdyn.files.output_files import append, replace, target_of, unwritable, writable

MAX_BYTES = 2**30  # larger files are refused
_BEGIN = b'{"'  # beginning of each line


class Journal:
    """A file of records, to which more are added.

    Attributes:
      header: the first line of the file.
      records: the other lines that the file had when it was opened.
    """

    def __init__(self, path: str | Path, layout: Layout, about: dict[str, Any], patience: float):
        """Begin a file, or open the one that is there.

        Args:
          path: path of the file.
          layout: the layout of the file.
          about: further entries of its first line.
          patience: how long to wait for other programs that write the file [s].
        Raises:
          ValueError: the file is of another kind, was edited, cannot be written, or another program
            writes it.
        """
        self._path = writable(path)
        # All threads of this program share the lock, since any of them may add a line.
        lock = _lock_of(self._path)
        self._lock = filelock.FileLock(lock, timeout=patience, thread_local=False)
        with self._hold_lock():
            self.header, *self.records = self._open(json_text(layout.header | about), layout)

    def _open(self, first: bytes, layout: Layout) -> list[dict[str, Any]]:
        """The lines of the file; a new file begins with the line `first`."""
        data = _whole_lines(self._path, layout.format, layout.remedy) or first
        found = _records(data, self._path, layout.format, layout.remedy)
        # Check the layout before anything is removed from a file of another kind.
        layout.check(found[0], "path")
        try:
            if data is not first:
                os.truncate(self._path, len(data))
            elif self._path.exists() and not first.startswith(self._path.read_bytes()):
                raise _damage_error(self._path, layout.format, layout.remedy, "no whole line")
            else:
                replace(self._path, first)
        except OSError as error:
            raise unwritable(self._path, error) from error
        self._size = len(data)
        return found

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
        """A context in which no other program can write the file; it may be nested.

        Raises:
          ValueError: another program writes the file, or has written it since it was opened.
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
        except NotImplementedError as error:  # raised by filelock where there are no locks
            raise unwritable(
                self._path, OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))
            ) from error
        try:
            yield
        finally:
            self._lock.release()


def remove(path: Path) -> None:
    """Remove a file that is no longer needed, and its lock."""
    path.unlink()
    _lock_of(path).unlink(missing_ok=True)


def _lock_of(path: Path) -> Path:
    """The path of the lock of a file, beside the file to which symbolic links lead."""
    target = target_of(path)
    return target.with_name(f"{target.name}.lock")


def read(path: str | Path, layout: Layout) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The first line of a file and the others; the file may still be being written.

    Raises:
      ValueError: the file is of another kind, or was edited.
    """
    header, *rest = lines(path, layout.format, layout.remedy)
    layout.check(header, "path")
    return header, rest


def lines(path: str | Path, kind: str, remedy: str) -> list[dict[str, Any]]:
    """The lines of a file, whose kind is not checked.

    Raises:
      ValueError: the file is not a journal, or was edited.
    """
    return _records(_whole_lines(as_path(path), kind, remedy), path, kind, remedy)


def _whole_lines(path: Path, kind: str, remedy: str) -> bytes:
    """The content of a file up to its last line break; nothing where there is no file."""
    data = content(path, MAX_BYTES, remedy) if path.exists() else b""
    size = data.rfind(b"\n") + 1
    # A file system may have allocated space for a line that was not written when a machine failed.
    rest = data[size:].rstrip(b"\0")
    if size and not (rest.startswith(_BEGIN) or _BEGIN.startswith(rest)):
        raise _damage_error(path, kind, remedy, "something after its last line")
    if _is_whole(data[size:-1]):
        raise _damage_error(path, kind, remedy, "another byte for a line break")
    return data[:size]


def _is_whole(data: bytes) -> bool:
    """Whether data are a whole line without its line break."""
    try:
        return has_digest(data + b"\n")
    except ValueError:
        return False


def _records(data: bytes, path: str | Path, kind: str, remedy: str) -> list[dict[str, Any]]:
    """The records of lines, without their digests."""
    try:
        return [_record(each + b"\n") for each in data.removesuffix(b"\n").split(b"\n")]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _damage_error(path, kind, remedy, str(error)) from error


def _record(line: bytes) -> dict[str, Any]:
    digested = has_digest(line)
    record = parse_json(line, "a line of another type")
    claimed = record.pop("digest")
    # Older files have a digest of the values.
    if not digested and claimed != digest_of_values(record):
        raise KeyError("digest")
    return record


def _damage_error(path: str | Path, kind: str, remedy: str, why: str) -> ValueError:
    got = f"'{path}', which is another or was edited ({why[:80]})"
    return fail("path", f"a {kind} file", got, remedy)
