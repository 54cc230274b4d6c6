"""Common parts of the commands that begin at an equilibrium."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

import jaxdyn
from jaxdyn._text import fail, whole
from jaxdyn.cli.shared import output_option
from jaxdyn.files.output_files import writable
from orbits.cli.shared import numbers

KeepOption = Annotated[
    Path | None,
    output_option(writable, "Write it to this file (.jsonl), and resume from it.", "--save"),
]


class Noted(NamedTuple):
    """What the file of a continuation notes about the command that wrote it."""

    scene: str
    settings: dict[str, str]
    parameters: list[str]


StartOption = Annotated[
    str | None,
    typer.Option(metavar="A,B,..", help="State near an equilibrium; the scene's start by default."),
]


def check_walk(members: int, step: float) -> None:
    """Raise ValueError unless both numbers are positive."""
    whole("--members", members)
    if not 0 < step < math.inf:
        raise fail("--step", "> 0", step, "It is a length in the space of the unknowns.")


def equilibrium_start(name: str, values: dict, start: str | None) -> list[float]:
    """The state near which an equilibrium is sought."""
    if start is not None:
        return list(numbers("--start", start))
    return jaxdyn.scenes.catalogue.entry(name).make(**values).y0.tolist()


def open_file(
    path: Path | None, name: str, settings: Mapping[str, str], parameters: Sequence[str]
) -> "jaxdyn.continuation.checkpoint.Log | None":
    """The file of a continuation, with a note about its scenes."""
    if path is None:
        return None
    log = jaxdyn.continuation.checkpoint.Log(path)
    note = Noted(name, dict(settings), list(parameters))._asdict()
    others = [known for known in log.notes if known.keys() == note.keys() and known != note]
    if others:
        odd = next(key for key in note if others[0][key] != note[key])
        remedy = "Give another path, or the arguments of the run that began this file."
        raise fail("--save", "a file of this run", f"one with other {odd}: {path}", remedy)
    log.note(note)
    return log
