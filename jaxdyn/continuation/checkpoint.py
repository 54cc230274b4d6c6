"""Branches in a file, member by member, so that an interrupted run can resume from it.

A file holds the walks of a run, each with its first member and whatever distinguishes it from
others. A walk is recognised by these, whatever else the file contains, and continues where it was
left; it may then be longer. Files contain numbers only: the scene has to be given again when a file
is read.

Only one program at a time may write a file; others are refused. Steps are numbered, so that a file
in which the steps of two runs are mixed is refused.
"""

import contextlib
import copy
import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxdyn._checks import fail
from jaxdyn.files import journal
from jaxdyn.files.codec import decode, encode
from jaxdyn.files.layout import Layout

_UNNUMBERED = 1  # the version whose steps have no numbers
LAYOUT = Layout("jaxdyn-continuation", 3, "a continuation", {_UNNUMBERED: True, 2: True})
OTHER = "The file was edited or damaged, or its scenes are others."
#: The kinds of walks of this package.
WHATS = EQUILIBRIA, CURVE = "equilibria", "curve"
_MIXED = "Two programs wrote it at the same time. Begin another one."
_PATIENCE = 1.0  # [s] to wait for another program; one that writes a file usually takes longer
_SAME = 1e-8  # relative distance below which two first members are the same


class Advance(NamedTuple):
    """One step of a walk.

    Attributes:
      member: the new member; None where the walk ends without one.
      special: the special points before it.
      step: length of the next step.
      end: why the walk ends, "" if it does not; with a member, it ends within the bounds of the run
        that found it, and other bounds may lead on.
    """

    member: Any
    special: list[Any]
    step: float
    end: str

    def map(self, convert: Callable[[Any], Any]) -> "Advance":
        """The same step, with its member and special points converted."""
        member = None if self.member is None else convert(self.member)
        return self._replace(member=member, special=[convert(point) for point in self.special])


class Codec(NamedTuple):
    """The conversion of the members of a walk to JSON, and back."""

    encode: Callable[[Any], Any]
    decode: Callable[[Any], Any]


def of_fields(cls: type) -> Codec:
    """The codec of a dataclass of numbers, strings and arrays."""
    return Codec(encode, lambda record: decode(record, cls, "file", OTHER))


@dataclasses.dataclass(frozen=True)
class Begin:
    """The first line of a walk.

    Attributes:
      what: kind of the walk, such as "equilibria".
      step: length of the first step.
      place: (n,) the first member and its tangent, in units.
      first: the first member.
      about: further data that distinguish it from others, and are needed to read it.
      note: further notes in the file.
      walk: its number in the file.
    """

    what: str
    step: float
    place: np.ndarray
    first: Any
    about: dict = dataclasses.field(default_factory=dict)
    note: dict = dataclasses.field(default_factory=dict)
    walk: int = 0

    def same(self, other: "Begin", place: Callable[["Begin"], np.ndarray]) -> bool:
        """Whether it begins the same walk: its first member and step agree to rounding.

        Args:
          other: the beginning of another walk.
          place: computes the place of this first member in the units of the other one; `self.place`
            may be in other units, those of an earlier version.
        """
        if (self.what, self.about) != (other.what, other.about):
            return False
        if not math.isclose(self.step, other.step, rel_tol=_SAME):
            return False
        a, b = place(self), other.place
        return a.shape == b.shape and bool(np.abs(a - b).max() <= _SAME * (1.0 + np.abs(b).max()))


@dataclasses.dataclass
class SavedBranch:
    """A walk in a file.

    Attributes:
      begin: its first line.
      steps: its steps.
      end: why it ended when it was last followed, "" if it was interrupted.
    """

    begin: Begin
    steps: list[Advance] = dataclasses.field(default_factory=list)
    end: str = ""

    def read(self, codec: Codec) -> tuple[Any, list[Advance]]:
        """The first member and the steps.

        Raises:
          ValueError: a record is not that of a member.
        """
        return codec.decode(self.begin.first), [step.map(codec.decode) for step in self.steps]


class Log:
    """A file of walks."""

    def __init__(self, path: str | Path):
        """Open a file, or begin one.

        Raises:
          ValueError: it is a file of another kind, was edited or cannot be written, or another
            program is writing it.
        """
        self._file = journal.Journal(path, LAYOUT, {}, _PATIENCE)
        self._note: dict = {}
        self.walks, self.notes = _read_walks(self._file.header, self._file.records)

    def with_note(self, **note: Any) -> "Log":
        """The same file, in which new walks begin with a note."""
        other = copy.copy(self)
        other._note = note
        return other

    def resume(
        self, begin: Begin, codec: Codec, place: Callable[[Any], np.ndarray]
    ) -> "tuple[Any, Checkpoint]":
        """The first member of a walk and the rest of it: from the file, or begun in it."""
        for walk in self.walks:
            if walk.begin.same(begin, lambda known: place(codec.decode(known.first))):
                first, advances = walk.read(codec)
                return first, Checkpoint(self._file, walk.begin.walk, codec, advances, walk.end)
        first = begin.first
        number, record = len(self.walks), codec.encode(first)
        begin = dataclasses.replace(begin, walk=number, first=record, note=self._note)
        self._file.add({"begin": encode(begin)})
        self.walks.append(SavedBranch(begin))
        return first, Checkpoint(self._file, begin.walk, codec, [], "")

    def note(self, note: dict) -> None:
        """Add a note, unless it is there already."""
        if note not in self.notes:
            with self.lock():
                self.notes.append(note)
                self._file.add({"note": note})

    def lock(self) -> contextlib.AbstractContextManager[None]:
        """Keep other programs from writing the file; see `Journal.alone`."""
        return self._file.alone()


class Checkpoint:
    """The steps of a walk in a file.

    Attributes:
      advances: the steps that the file has.
    """

    def __init__(self, file: journal.Journal, walk: int, codec: Codec, advances, end: str):
        self.advances: list[Advance] = advances
        self._file, self._walk, self._codec, self._end = file, walk, codec, end
        self._number = len(advances)  # number of the next step

    def add(self, advance: Advance) -> None:
        """Add a step; it is on the disk when this returns."""
        step = advance.map(self._codec.encode)
        self._file.add({"walk": self._walk, "number": self._number, "step": encode(step)})
        self._number += 1

    def finish(self, end: str) -> None:
        """Say why the walk ends."""
        if end != self._end:
            self._file.add({"walk": self._walk, "ended": end})


@contextlib.contextmanager
def resume(
    path: str | Path | Log | None,
    begin: Begin,
    codec: Codec,
    place: Callable[[Any], np.ndarray],
) -> Iterator[tuple[Any, Checkpoint | None]]:
    """The first member of a walk, and the rest of it in a file, if there is one.

    No other program writes the file meanwhile. `place` is that of a member in the units of the
    first one.
    """
    log = open_log(path)
    with lock(log):
        yield (begin.first, None) if log is None else log.resume(begin, codec, place)


def lock(log: Log | None) -> contextlib.AbstractContextManager[None]:
    """Keep other programs from writing a file, if there is one; see `Journal.alone`."""
    return contextlib.nullcontext() if log is None else log.lock()


def open_log(path: str | Path | Log | None) -> Log | None:
    """The file of a path; None for no path."""
    if not isinstance(path, str | Path | Log | None):
        raise fail("path", "the path of a file, or None", repr(path)[:40])
    return Log(path) if isinstance(path, str | Path) else path


def walks_in(path: str | Path, whats: Iterable[str]) -> tuple[list[SavedBranch], list[dict]]:
    """The walks of some kinds in a file, and its notes; even while it is being written.

    Raises:
      ValueError: it is a file of another kind, was edited, or has no walk of these kinds.
    """
    walks, notes = _read_walks(*journal.read(path, LAYOUT))
    found = [walk for walk in walks if walk.begin.what in whats]
    if not found:
        got = f"{path}, which has " + (", ".join(sorted({x.begin.what for x in walks})) or "none")
        raise fail("path", f"a file of {' or '.join(whats)}", got, LAYOUT.remedy)
    return found, notes


def _read_walks(header: dict, records: list[dict]) -> tuple[list[SavedBranch], list[dict]]:
    walks: list[SavedBranch] = []
    notes: list[dict] = []
    for record in records:
        if "begin" in record:
            begin = decode(record["begin"], Begin, "file", OTHER)
            _check_number("walks", begin.walk, len(walks))
            walks.append(SavedBranch(begin))
        elif "note" in record:
            notes.append(decode(record["note"], dict, "file", OTHER))
        else:
            number = decode(record.get("walk"), int, "file", OTHER)
            if not 0 <= number < len(walks):
                raise fail("file", "steps of a walk that has begun", f"one of {number}", OTHER)
            if "step" in record:
                steps = walks[number].steps
                if header["version"] != _UNNUMBERED:
                    number = decode(record.get("number"), int, "file", OTHER)
                    _check_number("steps", number, len(steps))
                steps.append(decode(record["step"], Advance, "file", OTHER))
            else:
                walks[number].end = decode(record.get("ended"), str, "file", OTHER)
    return walks, notes


def _check_number(what: str, number: int, expected: int) -> None:
    if number != expected:
        got = f"number {number} in the place of {expected}"
        raise fail("file", f"{what} in order", got, _MIXED)
