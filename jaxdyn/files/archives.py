"""Archives of NumPy (.npz) with arrays and one JSON text; nothing here loads JAX.

They are written atomically and read without trusting them: entries are not compressed, so that a
claimed size is compared with the number of bytes before an array is made, and no entry is
unpickled. The comment at the end of an archive is a digest of all of its other bytes.
"""

import io
import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxdyn._text import fail
from jaxdyn.files.digests import DIGITS, has_digest, plain_text, with_digest
from jaxdyn.files.input_files import content, parse_json
from jaxdyn.files.output_files import archive_path, replace, unwritable

#: Most bytes of an archive, which is in memory as a whole.
MAX_BYTES = 2**30
#: What entries may hold: floats, whole numbers, truth values.
_TYPES = ("<f8", "<i8", "<i4", "|b1")
_DATE = (1980, 1, 1, 0, 0, 0)  # one date, so that the same motion gives the same file
_ARRAY = ".npy"
_COMMENT = b"digest: "


def write(path: str | Path, name: str, record: Any, arrays: Mapping[str, np.ndarray]) -> None:
    """Write a record and arrays, atomically: a killed process leaves the old file.

    Args:
      path: path of the .npz file.
      name: name of the entry with the record.
      record: the record, for JSON.
      arrays: the arrays by name.
    Raises:
      ValueError: `path` cannot be written, the record has numbers that are not finite, an array
        has another type, or the archive would be larger than `read` accepts.
    """
    path = archive_path(path)
    entries = {name: plain_text(record, indent=1)}
    entries |= {key + _ARRAY: _pack(key, x) for key, x in arrays.items()}
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for key, data in entries.items():
            archive.writestr(zipfile.ZipInfo(key, _DATE), data)
        archive.comment = _COMMENT + bytes(DIGITS)  # its length is part of the archive
    text = file.getvalue()[:-DIGITS]
    text = with_digest(text, len(text))
    if len(text) > MAX_BYTES:
        remedy = "Save fewer samples, or the motions of a batch one by one."
        raise fail("file", f"at most {MAX_BYTES} bytes", len(text), remedy)
    try:
        replace(path, text)
    except OSError as error:
        raise unwritable(path, error) from error


class Read(NamedTuple):
    """The contents of an archive.

    Attributes:
      record: the record, from JSON.
      arrays: the arrays by name.
      digested: whether it has a digest, as all archives written by `write` do.
    """

    record: Any
    arrays: dict[str, np.ndarray]
    digested: bool


def read(path: str | Path, name: str, remedy: str) -> Read:
    """The record and the arrays of an archive.

    Args:
      path: path of the file.
      name: name of the entry with the record.
      remedy: what to do if it is not such an archive, for the message.
    Raises:
      ValueError: it is not an archive that `write` wrote, or a byte of it changed.
    """
    data = content(path, MAX_BYTES, remedy, "path")
    digested = has_digest(data, "path", remedy)
    try:
        entries = _entries(data)
    # zipfile raises these errors for files that it does not accept.
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise fail("path", "an archive (.npz)", f"{path} ({error})", remedy) from error
    if name not in entries:
        raise fail("path", f"an archive with the entry {name}", f"{path} without it", remedy)
    record = parse_json(entries.pop(name), str(path), remedy)
    arrays = {key.removesuffix(_ARRAY): _unpack(key, x) for key, x in entries.items()}
    return Read(record, arrays, digested)


def _entries(data: bytes) -> dict[str, bytes]:
    """The bytes of each entry, in total no more than the archive has."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        found = archive.infolist()
        if any(entry.compress_type != zipfile.ZIP_STORED for entry in found):
            raise zipfile.BadZipFile("compressed entries, which may hide any size")
        if sum(entry.file_size for entry in found) > len(data):
            raise zipfile.BadZipFile("entries of more bytes than it has")
        if len({entry.filename for entry in found}) < len(found):
            raise zipfile.BadZipFile("two entries of one name")
        return {entry.filename: archive.read(entry) for entry in found}


def _pack(name: str, x: np.ndarray) -> bytes:
    if x.dtype.str not in _TYPES:
        raise fail(name, f"an array of {', '.join(_TYPES)}", x.dtype.str)
    file = io.BytesIO()
    np.lib.format.write_array(file, np.ascontiguousarray(x).reshape(x.shape), version=(1, 0))
    return file.getvalue()


def _unpack(name: str, data: bytes) -> np.ndarray:
    """The array of an entry, if it has as many bytes as its header claims."""
    file = io.BytesIO(data)
    try:
        if np.lib.format.read_magic(file) != (1, 0):
            raise ValueError("another version of the format")
        shape, by_columns, dtype = np.lib.format.read_array_header_1_0(file)
    except (ValueError, RecursionError, MemoryError) as error:
        got = " ".join(str(error).split())[:80]
        raise fail(f"entry {name[:40]}", "an array (.npy)", got) from error
    if by_columns or dtype.str not in _TYPES:
        raise fail(f"entry {name[:40]}", f"rows of {', '.join(_TYPES)}", f"{dtype}"[:80])
    room = len(data) - file.tell()
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != room:
        raise fail(f"entry {name[:40]}", f"a shape of {room} bytes", f"{shape}"[:80])
    return np.frombuffer(data, dtype, offset=file.tell()).reshape(shape)
