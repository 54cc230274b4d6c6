"""Families as lists: the data for tables, pictures and files, without the equations."""

import dataclasses
import math
import reprlib
from pathlib import Path
from typing import Any

from jaxdyn._checks import fail
from jaxdyn._records.kinds import check_first
from jaxdyn.continuation.kinds import Kind
from jaxdyn.files import records
from jaxdyn.files.digests import DAMAGED
from orbits.families.family import Family, Member
from orbits.files import encoding
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit

FORMAT = "jaxdyn-family"
VERSION = 4
_OLDER = {3: True}
_VERDICTS = ("stable", "unstable", "undecided")
_KEYS = {"format", "version", "parameter", "end", "members", "special"}
_ENTRY_KEYS = {"orbit", "parameter", "energy", "verdict", "kind"}


@dataclasses.dataclass(frozen=True)
class Entry:
    """One orbit of a list.

    Attributes:
      orbit: the orbit.
      parameter: its value of the family's parameter; NaN without one.
      energy: of the scene at the start; NaN without one.
      verdict: "stable", "unstable" or "undecided".
      kind: kind of special point, if it is one.
    """

    orbit: Orbit | HybridOrbit
    parameter: float
    energy: float
    verdict: str
    kind: Kind | None = None


@dataclasses.dataclass(frozen=True)
class Listing:
    """A family as a list.

    Attributes:
      parameter: name of the number that changes along it; None if only energy and period change.
      members: the orbits, in order.
      special: the special points between them.
      end: why it ends.
    """

    parameter: str | None
    members: tuple[Entry, ...]
    special: tuple[Entry, ...]
    end: str


@check_first
def listing(family: Family, parameter: str | None = None) -> Listing:
    """A family as a list; `parameter` is the name of its parameter, if it has one."""
    members, special = (tuple(map(_entry, many)) for many in (family.members, family.special))
    return Listing(parameter=parameter, members=members, special=special, end=family.end)


@check_first
def save(path: str | Path, family: Listing) -> None:
    """Write a family, atomically.

    Args:
      path: of the JSON file.
      family: from `listing`.
    Raises:
      ValueError: the folder does not exist, or a scene holds a function.
    """
    record = {"format": FORMAT, "version": VERSION} | as_json(family)
    records.write(path, record)


@check_first
def as_json(family: Listing) -> dict[str, Any]:
    """The list as a JSON object; NaN becomes null."""
    return {
        "parameter": family.parameter,
        "end": family.end,
        "members": [_record(entry) for entry in family.members],
        "special": [_record(entry) for entry in family.special],
    }


def load(path: str | Path) -> Listing:
    """The family in a file; each orbit can be reported on, and continued, like a new one.

    Raises:
      ValueError: not a readable family file of this version, or its data is invalid.
    """
    record = records.read(path, FORMAT, VERSION, _OLDER)
    if record.keys() != _KEYS:
        raise fail("file", f"the entries {sorted(_KEYS)}", sorted(record), DAMAGED)
    name, end = record["parameter"], record["end"]
    texts = [end] if name is None else [end, name]
    if not all(isinstance(text, str) and text.isprintable() for text in texts):
        raise fail("file", "a parameter's name and a reason for the end", "others", DAMAGED)
    members, special = (_entries(record[key], name) for key in ("members", "special"))
    if not members:
        raise fail("file", "at least one member", "none", DAMAGED)
    return Listing(parameter=name, members=members, special=special, end=end)


def _entry(member: Member) -> Entry:
    return Entry(
        orbit=member.orbit,
        parameter=member.parameter,
        energy=member.energy,
        verdict=member.stability.verdict,
        kind=member.kind,
    )


def _record(entry: Entry) -> dict[str, Any]:
    return {
        "orbit": encoding.encode(entry.orbit),
        "parameter": _number(entry.parameter),
        "energy": _number(entry.energy),
        "verdict": entry.verdict,
        "kind": entry.kind,
    }


def _number(x: float) -> float | None:
    return x if math.isfinite(x) else None


def _entries(several: Any, parameter: str | None) -> tuple[Entry, ...]:
    if not isinstance(several, list):
        raise fail("file", "a list of orbits", type(several).__name__, DAMAGED)
    return tuple(_decode(record, parameter) for record in several)


def _decode(record: Any, parameter: str | None) -> Entry:
    if not isinstance(record, dict) or record.keys() != _ENTRY_KEYS:
        raise fail("file", f"orbits with {sorted(_ENTRY_KEYS)}", "others", DAMAGED)
    value, energy, verdict, kind = (record[k] for k in ("parameter", "energy", "verdict", "kind"))
    orbit = encoding.decode(record["orbit"])
    has_energy = orbit.scene.has_energy
    numbers = [energy] * has_energy + [value] * (parameter is not None)
    if not all(isinstance(x, int | float) and not isinstance(x, bool) for x in numbers):
        raise fail("file", "numbers for energy and parameter", reprlib.repr(numbers), DAMAGED)
    if verdict not in _VERDICTS or kind not in (None, *Kind):
        raise fail("file", "a verdict and a kind", reprlib.repr((verdict, kind)), DAMAGED)
    return Entry(
        orbit=orbit,
        parameter=math.nan if parameter is None else float(value),
        energy=float(energy) if has_energy else math.nan,
        verdict=verdict,
        kind=None if kind is None else Kind(kind),
    )
