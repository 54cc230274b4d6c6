"""One `load` for files of every kind: the format that a file states determines its reader.

Packages above this one register readers for their kinds when they are imported; the readers' own
modules are imported when such a file is read. Nothing in a file is imported or executed.
"""

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxdyn._text import fail
from jaxdyn.files import journal
from jaxdyn.files.input_files import content
from jaxdyn.files.layout import format_of

_REMEDY = "Give the path of a file that this library wrote."
_ARCHIVE = b"PK"  # the first bytes of an archive of NumPy
_MOTION = "jaxdyn-motion"
_CONTINUATION = "jaxdyn-continuation"
#: The "module:function" that reads files of each kind. A file of continuations is of the kinds of
#: its branches.
_READERS = {
    _MOTION: "jaxdyn.files.motion_files:load",
    f"{_CONTINUATION} of equilibria": "jaxdyn.continuation:load",
    f"{_CONTINUATION} of curve": "jaxdyn.continuation:load",
}


def register(readers: Mapping[str, str]) -> None:
    """Let `load` read files of further kinds, each by a "module:function" that takes the path."""
    _READERS.update(readers)


def load(path: str | Path, *of: Any, **options: Any) -> Any:
    """The contents of a file that this library wrote, whatever its kind.

    Args:
      path: path of the file: of a motion; of an orbit, a family of orbits, a chain of legs or a
        search (after ``import orbits``); or of a continuation (its ``path=``).
      of: what the file does not hold. Files of continuations hold only numbers and need the
        function that makes the scenes, as it was given to the continuation; files of chains need
        the legs.
      options: options of the reader: `closes` for chains; `scene` for motions, orbits and families
        of a scene that holds functions, such as `jaxdyn.ode`. It is a scene with these functions,
        and its numbers are replaced by those of the file.
    Returns:
      A motion or a chain of phases; for a continuation, families of equilibria and curves, or a
      diagram if it has orbits; an orbit or a chain, with the file's claims, as described in
      `orbits.load`; for a family, its `Listing`; for a search, its description and its chunks.
    Raises:
      ValueError: `path` is not such a file or is of a kind that no imported package reads, it is
        damaged or edited, `of` does not fit its kind, or it names a class that is not imported.
    Example:
      >>> import tempfile, jaxdyn
      >>> motion = jaxdyn.simulate(jaxdyn.scenes.pendulum(), 1.0, samples=5)
      >>> with tempfile.TemporaryDirectory() as folder:
      ...     motion.save(f"{folder}/swing.npz")
      ...     back = jaxdyn.load(f"{folder}/swing.npz")
      >>> bool((back.ys == motion.ys).all()), back.scene.name
      (True, 'pendulum')
    """
    kinds = _kinds(path)
    # The last reader accepts the most: the one for diagrams also reads families of equilibria.
    known = [reader for kind, reader in _READERS.items() if kind in kinds]
    if not known:
        got = f"{path} of {kinds[0]!r:.40}" if kinds else f"{path} without a format"
        remedy = f"{_REMEDY} If another package reads such files, import it first."
        raise fail("path", "a file of a kind that is read here", got, remedy)
    module, _, name = known[-1].partition(":")
    read = getattr(importlib.import_module(module), name)
    return read(path, *of, **options)


def _kinds(path: str | Path) -> list[str]:
    """The kinds that a file states; the file of a continuation may state several."""
    data = content(path, journal.MAX_BYTES, _REMEDY, "path")
    if data.startswith(_ARCHIVE):
        return [_MOTION]  # its reader reports what is wrong with it, if anything
    if not data.startswith(b"{"):
        wanted = "an archive (.npz) or a text of JSON that this library wrote"
        remedy = f"{_REMEDY} jaxdyn.read_csv reads tables, jaxdyn.ode makes scenes of equations."
        raise fail("path", wanted, f"{path}, which is neither", remedy)
    kind = format_of(path, _REMEDY, "path", journal.MAX_BYTES)
    if kind != _CONTINUATION:
        return [] if kind is None else [kind]
    begun = [record["begin"] for record in journal.lines(path, kind, _REMEDY) if "begin" in record]
    return [f"{kind} of {begin.get('what')}" for begin in begun if isinstance(begin, dict)] or [
        f"{kind} of equilibria"  # a file that has no branch yet
    ]
