"""Rows of numbers that a long computation finds in order, kept in a journal.

A computation that is repeated with the same inputs reads the rows that the file has, and computes
the others, a chunk at a time. It takes the same chunks as a run without an interruption, so that
its result is the same to the last bit.
"""

import contextlib
import hashlib
import json
import re
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxdyn._checks import fail
from jaxdyn.files.codec import decode, encode
from jaxdyn.files.digests import DAMAGED
from jaxdyn.files.journal import Journal
from jaxdyn.files.layout import Layout

_PATIENCE = 0.0  # [s] to wait for another program that writes the file, which may take long
#: The address of an object in memory, which the texts of some programs contain.
_ADDRESS = re.compile(r"0x[0-9a-f]+")
_ANOTHER = "Give another path, or delete the file."


class Chunk(NamedTuple):
    """A chunk of rows.

    Attributes:
      rows: (n, m) the numbers.
    """

    rows: np.ndarray


class Rows:
    """Rows of numbers that are computed in chunks; those of a file are not computed again.

    Attributes:
      chunk: number of rows of a chunk.
    """

    def __init__(self, journal: Journal | None, chunk: int, executor: Executor | None = None):
        self._journal, self.chunk = journal, chunk
        self._map = map if executor is None else executor.map
        self._whole = journal is None and executor is None
        found = [] if journal is None else journal.records
        self._known = [decode(record, Chunk, "path", DAMAGED).rows for record in found]
        self._next = 0

    def compute(self, inputs: Any, function: Callable[[Any], np.ndarray]) -> np.ndarray:
        """The rows (n, m) of a function of inputs, which are a pytree of arrays with n rows.

        When a file is continued, calls must come in the same order as before.
        """
        n = len(jax.tree.leaves(inputs)[0])
        if self._whole:
            return function(inputs)
        counts = [min(self.chunk, n - first) for first in range(0, n, self.chunk)]
        known = self._known[self._next : self._next + len(counts)]
        self._next += len(known)
        for rows, count in zip(known, counts, strict=False):
            if rows.ndim != 2 or len(rows) != count:
                raise fail("path", f"{count} rows in a line", str(rows.shape), DAMAGED)
        left = [
            jax.tree.map(lambda x, first=first: x[first : first + self.chunk], inputs)
            for first in range(len(known) * self.chunk, n, self.chunk)
        ]
        return np.concatenate([*known, *map(self._keep, self._map(function, left))])

    def _keep(self, found: Any) -> np.ndarray:
        rows = np.asarray(found, float)
        if self._journal is not None:
            self._journal.add(encode(Chunk(rows)))
        return rows


@contextlib.contextmanager
def rows_in(
    path: str | Path | None, layout: Layout, of: Any, chunk: int, executor: Executor | None = None
) -> Iterator[Rows]:
    """A context in which rows are computed, and kept in a file that no other program can write.

    Args:
      path: path of the file (.jsonl); None for no file.
      layout: the layout of the file.
      of: arrays, numbers and texts on which the rows depend; a file of others is refused.
      chunk: number of rows of a line.
      executor: computes the chunks; by default they are computed here, one after the other.
    Raises:
      ValueError: the file belongs to another computation, was edited, cannot be written, or another
        program writes it.
    """
    if path is None:
        yield Rows(None, chunk, executor)
        return
    about = {"of": _digest(of), "chunk": chunk}
    journal = Journal(path, layout, about, _PATIENCE)
    if journal.header != json.loads(json.dumps(layout.header | about)):
        raise fail("path", "the file of this call", f"'{path}', of another", _ANOTHER)
    with journal.alone():
        yield Rows(journal, chunk, executor)


def program_text(function: Callable, *args: Any) -> tuple[str, list[np.ndarray]]:
    """The program of a function of arrays as text, the same in every process, and its constants."""
    program = jax.make_jaxpr(function)(*args)
    return _ADDRESS.sub("", str(program)), [np.asarray(x) for x in program.consts]


def _digest(of: Any) -> str:
    found = hashlib.sha256()
    for one in jax.tree.leaves(of):
        x = np.asarray(one)
        found.update(f"{x.dtype} {x.shape} ".encode())
        found.update(np.ascontiguousarray(x).tobytes())
    return found.hexdigest()
