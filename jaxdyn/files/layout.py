"""The layout of files: the header of each, and documents, which are written as a whole.

Every file of results has one object of JSON whose entries `format` and `version` say what it is:
this object is the whole of a document (.json: an orbit, a family), the first line of a `journal`
(.jsonl: a search, a continuation), or an entry of an archive (.npz: a motion, `archives`). The name
of a format never changes, so that a file of any version, older or newer, is recognised. All files
end with digests of their bytes (`digests`), and the `codec` writes and reads what is in them.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from jaxdyn._text import fail
from jaxdyn.files import digests
from jaxdyn.files.input_files import MAX_BYTES, content, parse_json
from jaxdyn.files.output_files import replace, unwritable, writable


class Layout(NamedTuple):
    """A kind of files.

    Attributes:
      format: name of the kind in files.
      version: the version that is written.
      writer: the function or option that writes such files, for messages.
      older: older versions that are read too, and whether their files have a digest of their
        values, which some had before digests were of bytes.
    """

    format: str
    version: int
    writer: str
    older: Mapping[int, bool] = {}

    @property
    def header(self) -> dict[str, Any]:
        """The first entries of a file."""
        return {"format": self.format, "version": self.version}

    @property
    def remedy(self) -> str:
        """What to do if a file is not of this kind, for messages."""
        return f"Give the path of a file that {self.writer} wrote."

    def check(self, record: Any, name: str = "file") -> None:
        """Raise ValueError unless a record is of this kind and of a version that is read."""
        is_object = isinstance(record, dict)
        if not is_object or record.get("format") != self.format:
            got = record.get("format") if is_object else type(record).__name__
            raise fail(name, f"format {self.format!r}", repr(got)[:40], self.remedy)
        version = record.get("version")
        if type(version) is not int or version not in (self.version, *self.older):
            newer = type(version) is int and version > self.version
            remedy = "Update this program." if newer else "Make the file again."
            raise fail(name, f"version {self.version}", repr(version)[:40], remedy)

    def write(self, path: str | Path, record: dict[str, Any]) -> None:
        """Write a record to a document, atomically: a killed process leaves the old file.

        Raises:
          ValueError: `path` cannot be written, the record has numbers that are not finite, or the
            file would be larger than `read` takes.
        """
        path = writable(path, name="file")
        text = digests.json_text(self.header | record, indent=1)
        if len(text) > MAX_BYTES:
            raise fail("record", f"at most {MAX_BYTES} bytes", len(text), "Save less in one file.")
        try:
            replace(path, text)
        except OSError as error:
            raise unwritable(path, error, "file") from error

    def read(self, path: str | Path) -> dict[str, Any]:
        """The record in a document, without its header and its digest.

        Raises:
          ValueError: it is a file of another kind or version, or a byte of it changed.
        """
        data = content(path, MAX_BYTES, self.remedy)
        digested = digests.has_digest(data)
        record = parse_json(data, str(path), self.remedy)
        self.check(record)
        claimed = record.pop("digest", None)
        version = record["version"]
        if not digested:
            if version not in self.older:
                raise fail("file", "a digest at its end", "none", digests.DAMAGED)
            if claimed != (digests.digest_of_values(record) if self.older[version] else None):
                raise fail("file", "data that match its digest", "other data", digests.DAMAGED)
        return {key: x for key, x in record.items() if key not in self.header}


def format_of(
    path: str | Path, remedy: str, name: str = "file", most: int = MAX_BYTES
) -> str | None:
    """The format that a document or a journal says it has; None if it says none.

    Args:
      path: path of the file.
      remedy: what to do if it is not such a file, for the message.
      name: name of the argument or option, for the message.
      most: largest number of bytes of a journal; a document has at most `MAX_BYTES`.
    Raises:
      ValueError: it does not begin with JSON.
    """
    data = content(path, most, remedy, name)
    first = data[: data.find(b"\n") + 1]
    if not first.rstrip().endswith(b"}"):
        if len(data) > MAX_BYTES:
            raise fail(name, f"at most {MAX_BYTES} bytes", "more", remedy)
        first = data
    record = parse_json(first, str(path), remedy)
    found = record.get("format") if isinstance(record, dict) else None
    return found if isinstance(found, str) else None
