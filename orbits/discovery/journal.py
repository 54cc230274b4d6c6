"""The file of a search: the results of each chunk, one line of JSON per chunk.

The first line describes the search; each other line is the result of one chunk, written and
flushed to disk at once. A reader therefore sees whole lines; an incomplete last line is ignored. A
search continues where its file ends, in whatever order the chunks were written. Several programs
may write one file. Each line ends with a digest of the rest: a file that was edited is refused.
"""

import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.files import journal
from jaxdyn.files.codec import decode, encode
from jaxdyn.files.digests import DAMAGED
from jaxdyn.files.layout import Layout
from orbits.analysis.same import same_orbit
from orbits.closing.closings import Closing
from orbits.orbit import Orbit, Outcome

LAYOUT = Layout("jaxdyn-search", 3, "a search")
_PATIENCE = 60.0  # [s] to wait for other programs, each of which writes for milliseconds
_ALIKE = 1e-6  # relative: invariants that differ by more belong to different orbits
_SAME_START = 1e-8  # relative: starts this close are the same


@dataclasses.dataclass(frozen=True)
class Find:
    """A verified orbit that a search found.

    Attributes:
      sample: number of the sample that led to it.
      y0: its start.
      period: its shortest period.
      closing: the condition it satisfies: 0 for the search's, 1 for plain closing.
      residual: largest entry of the closing error.
      s_period: the period in logarithmic time, if that is used; else 0.
      recheck: its closing error over a period by another integrator, at a tighter tolerance.
      invariant: the scale-free T |E|^(3/2), where all forces are Newtonian attractions; else the
        period.
      verdict: the verdict on its stability.
      multiplier: size of its largest multiplier.
      label: its name, by the search's `label`.
    """

    sample: int
    y0: tuple[float, ...]
    period: float
    closing: int
    residual: float
    s_period: float
    recheck: float
    invariant: float
    verdict: str
    multiplier: float
    label: str

    def orbit(self, scene: Scene, closings: tuple[Closing, ...], rtol: float) -> Orbit:
        """The find as an orbit of the scene searched."""
        closing = closings[self.closing]
        scene = scene.starting(np.array(self.y0), self.period)
        s_period = self.s_period or None
        return Orbit(
            scene=scene,
            closing=closing,
            residual=self.residual,
            outcome=Outcome.FOUND,
            iterations=0,
            rtol=rtol,
            s_period=s_period,
        )


@dataclasses.dataclass(frozen=True)
class Chunk:
    """The result of one chunk of a search.

    Attributes:
      number: its index.
      counts: number of samples, guesses and so on at each stage.
      finds: the orbits.
    """

    number: int
    counts: dict[str, int]
    finds: tuple[Find, ...]


class File:
    """Chunks written to a file; without a path they are only kept in memory."""

    def __init__(self, path: str | Path | None, what: dict[str, Any]):
        """Start a file, or continue one of the same search.

        Args:
          path: path of the file, or None.
          what: description of the search; a file of another search is refused.
        """
        self.chunks: dict[int, Chunk] = {}
        self._file = None
        if path is None:
            return
        self._file = journal.Journal(path, LAYOUT, what, _PATIENCE)
        header, found = LAYOUT.header | what, self._file.header
        if found != json.loads(json.dumps(header)):
            odd = sorted(k for k in {*found, *header} if found.get(k) != header.get(k))
            remedy = "Give another path, or the arguments of the search that started this file."
            raise fail("path", "a file of this search", f"one with another {odd[0]}", remedy)
        self.chunks = _chunks(self._file.records)

    def add(self, chunk: Chunk) -> None:
        """Add a chunk, unless it is there already."""
        if chunk.number in self.chunks:
            return
        self.chunks[chunk.number] = chunk
        if self._file is not None:
            self._file.add(encode(chunk))


def read(path: str | Path) -> tuple[dict[str, Any], list[Chunk]]:
    """The description of a search and its chunks by number; also while the search runs.

    Raises:
      ValueError: the file was not written by a search, or was edited.
    """
    header, records = journal.read(path, LAYOUT)
    chunks = _chunks(records)
    return header, [chunks[number] for number in sorted(chunks)]


def _chunks(records: list[dict[str, Any]]) -> dict[int, Chunk]:
    """The chunks in the lines of a file by number; of several with one number, the first."""
    found = [decode(record, Chunk, "path", DAMAGED, lines=True) for record in records]
    for find in (find for chunk in found for find in chunk.finds):
        if not (np.isfinite([*find.y0, find.period]).all() and find.closing in (0, 1)):
            raise fail("path", "finite starts and periods, closings 0 or 1", "others", DAMAGED)
    return {chunk.number: chunk for chunk in reversed(found)}


def distinct(
    finds: Iterable[Find], scene: Scene, closings: tuple[Closing, ...], rtol: float
) -> list[Find]:
    """The finds that are not the same orbit as an earlier one, sorted by invariant.

    Invariants are compared first, then starts; `orbits.same_orbit` decides in the end.
    """
    kept: list[Find] = []
    for find in finds:
        alike = [k for k in kept if abs(k.invariant - find.invariant) <= _ALIKE * k.invariant]
        if any(
            np.abs(np.subtract(k.y0, find.y0)).max() <= _SAME_START * max(map(abs, k.y0))
            for k in alike
        ):
            continue
        orbit = find.orbit(scene, closings, rtol) if alike else None
        if not any(same_orbit(k.orbit(scene, closings, rtol), orbit) for k in alike):
            kept.append(find)
    return sorted(kept, key=lambda find: (find.invariant, find.sample))
