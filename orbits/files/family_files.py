"""Families as lists: the data for tables, pictures and files, without the equations."""

import dataclasses
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import check_first, fail
from jaxdyn.continuation.kinds import Kind
from jaxdyn.files.codec import decode_fields, encode
from jaxdyn.files.digests import DAMAGED
from jaxdyn.files.layout import Layout
from orbits.families.family import Family, Member
from orbits.files.encoding import decode_orbit, encode_orbit
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit

LAYOUT = Layout("jaxdyn-family", 4, "orbits.save", {3: True})
_VERDICTS = ("stable", "unstable", "undecided")


class FamilyFile(NamedTuple):
    """The entries of a file; see `Listing`."""

    parameter: str | None
    end: str
    members: list[dict]
    special: list[dict]


@dataclasses.dataclass(frozen=True)
class Entry:
    """One orbit of a list.

    Attributes:
      orbit: the orbit.
      parameter: its value of the family's parameter; NaN without one.
      energy: energy of the scene at the start; NaN without one.
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
      parameter: name of the number that changes along the family; None if only energy and period
        change.
      members: the orbits, in order.
      special: the special points between them.
      end: why the family ends.
    """

    parameter: str | None
    members: tuple[Entry, ...]
    special: tuple[Entry, ...]
    end: str

    live = Family.live


@check_first
def listing(family: Family, parameter: str | None = None) -> Listing:
    """A family as a list; `parameter` is the name of its parameter, if it has one."""
    members, special = (tuple(map(_entry, many)) for many in (family.members, family.special))
    return Listing(parameter=parameter, members=members, special=special, end=family.end)


def parameter_name(family: Family) -> str | None:
    """A name for the parameter of a family whose own is not known; None without a parameter."""
    return None if np.isnan(family.parameters).any() else "parameter"


@check_first
def save(path: str | Path, family: Listing) -> None:
    """Write a family, atomically.

    Args:
      path: path of the JSON file.
      family: result of `listing`.
    Raises:
      ValueError: the folder does not exist, or `family` is one of chains, which hold functions.
    """
    LAYOUT.write(path, as_json(family))


@check_first
def as_json(family: Listing) -> dict[str, Any]:
    """The list as a JSON object; NaN becomes null."""
    members, special = ([*map(_record, each)] for each in (family.members, family.special))
    return encode(FamilyFile(family.parameter, family.end, members, special))


def load(path: str | Path, scene: Scene | None = None) -> Listing:
    """The family in a file; each orbit can be reported on, and continued, like a new one.

    Args:
      path: path of the JSON file.
      scene: for scenes that hold functions, one of the family; see `orbits.load`.
    Raises:
      ValueError: the file is not a readable family file of this version, its data is invalid, or
        its equations are not those of `scene`.
    """
    known = FamilyFile(**decode_fields(LAYOUT.read(path), FamilyFile, "file", DAMAGED))
    members, special = (
        tuple(_decode(record, known.parameter, scene) for record in each)
        for each in (known.members, known.special)
    )
    if not members:
        raise fail("file", "at least one member", "none", DAMAGED)
    return Listing(known.parameter, members, special, known.end)


def _entry(member: Member) -> Entry:
    return Entry(
        orbit=member.orbit,
        parameter=member.parameter,
        energy=member.energy,
        verdict=member.stability.verdict,
        kind=member.kind,
    )


def _record(entry: Entry) -> dict[str, Any]:
    return {"orbit": encode_orbit(entry.orbit)} | encode(entry, ("orbit",))


def _decode(record: dict, parameter: str | None, scene: Scene | None) -> Entry:
    fields = decode_fields(record, Entry, "file", DAMAGED, raw=("orbit",))
    orbit = fields["orbit"] = decode_orbit(fields["orbit"], scene)
    entry = Entry(**fields)
    if parameter is None:
        entry = dataclasses.replace(entry, parameter=math.nan)
    if not orbit.scene.has_energy:
        entry = dataclasses.replace(entry, energy=math.nan)
    numbers = [entry.energy] * orbit.scene.has_energy + [entry.parameter] * (parameter is not None)
    if not all(map(math.isfinite, numbers)):
        raise fail("file", "numbers for energy and parameter", numbers, DAMAGED)
    if entry.verdict not in _VERDICTS:
        raise fail("file", f"one of {', '.join(_VERDICTS)}", repr(entry.verdict)[:40], DAMAGED)
    return entry
