"""Orbit files: an orbit with all that is claimed of it, written and read."""

from pathlib import Path
from typing import Any

from jaxdyn._checks import fail
from jaxdyn.files import records
from orbits.analysis.report import Report, as_json, report
from orbits.files import encoding
from orbits.orbit import Orbit

FORMAT = "jaxdyn-orbit"
VERSION = 4
_KEYS = {"format", "version", "claims"} | encoding.KEYS


def save(path: str | Path, orbit: Orbit, claims: Report | None = None) -> None:
    """Write an orbit with all claims about it, atomically.

    Args:
      path: of the JSON file.
      orbit: what `find` returned.
      claims: its report; made here by default.
    Raises:
      ValueError: the folder does not exist, or the scene holds a function.
    """
    claims = report(orbit) if claims is None else claims
    records.write(
        path,
        {
            "format": FORMAT,
            "version": VERSION,
            **encoding.encode(orbit),
            "claims": as_json(claims),
        },
    )


def load(path: str | Path) -> tuple[Orbit, dict[str, Any]]:
    """The orbit in a file, and the file's claims about it.

    Raises:
      ValueError: not a readable orbit file of this version, or its data is invalid.
    """
    record = records.read(path, FORMAT, VERSION)
    if record.keys() != _KEYS:
        raise fail("file", f"the entries {sorted(_KEYS)}", sorted(record), encoding.DAMAGED)
    orbit, claims = encoding.decode(record), record["claims"]
    if not isinstance(claims, dict):
        raise fail("file", "claims by name", type(claims).__name__, encoding.DAMAGED)
    return orbit, claims
