"""Records of pages, stored beside the site and made again only if sources changed."""

import functools
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jaxdyn.files.output_files import replace

SOURCES = ".sources"  # the folder within that of the site that Sphinx reads
_PACKAGES = tuple(Path(__file__).parents[2] / name for name in ("jaxdyn", "orbits"))
#: Files that change how a record is shown, not its contents.
_SHOWING = {"conf.py", "docstrings.py", "reference.py", "site.py", "sources.py", "texts.py"}


def keep(folder: Path, name: str, source: Path, make: Callable[[], dict[str, Any]]) -> dict:
    """The record of a page, made if it is missing, older than its sources or without its pictures.

    Args:
      folder: the folder of the site.
      name: the name of the page.
      source: its own file; all files of the library that can change the record count as well.
      make: runs the page and returns its record.
    """
    record = current(folder, name, source)
    if record is not None:
        return record
    record = {"digest": digest(source), **make()}
    path = _path(folder, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    replace(path, json.dumps(record))
    return record


def current(folder: Path, name: str, source: Path) -> dict | None:
    """The stored record of a page; None where `keep` would make it again."""
    record = stored_record(folder, name)
    if record is None or record["digest"] != digest(source):
        return None
    files = [one["file"] for one in record.get("drawings", ())]
    return record if all((pictures(folder) / file).exists() for file in files) else None


def pictures(folder: Path) -> Path:
    """The folder of a site's pictures before Sphinx copies them."""
    return folder / SOURCES / "pictures"


def stored_record(folder: Path, name: str) -> dict | None:
    """The stored record of a page; None if there is none that can be read."""
    try:
        record = json.loads(_path(folder, name).read_text())
    except (OSError, ValueError):
        return None
    return record if isinstance(record, dict) and "digest" in record else None


def digest(source: Path) -> str:
    """A digest of a page's own file and of the library."""
    return hashlib.sha256(source.read_bytes() + _library()).hexdigest()[:16]


def _path(folder: Path, name: str) -> Path:
    return folder / ".records" / f"{name}.json"


@functools.cache
def _library() -> bytes:
    found = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted(package.rglob("*.*")):
            if path.suffix in (".py", ".json") and _counts(path.relative_to(package)):
                found.update(str(path.relative_to(package)).encode() + path.read_bytes())
    return found.digest()


def _counts(path: Path) -> bool:
    """Whether a file can change every record; a page of the course changes only its own."""
    top = path.parts[0]
    page = top == "course" and len(path.parts) == 2
    return top != "cli" and not page and not (top == "gallery" and path.name in _SHOWING)
