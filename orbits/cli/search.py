"""The command `orbits search`: orbits of three equal bodies with zero angular momentum."""

from pathlib import Path
from typing import Annotated

import typer

import orbits
from jaxdyn._text import number_of
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import JsonOption, number, output_option
from jaxdyn.files.output_files import writable
from orbits.cli.shared import NOT_FOUND

_WORD = 24  # largest number of letters of a word that are shown
TableOption = Annotated[
    Path | None, output_option(writable, "Append to this .jsonl file.", "--table")
]


def search_command(
    samples: Annotated[int, typer.Option(help="Number of starts.")] = 512,
    longest: Annotated[float, number("Longest period.")] = 70.0,
    seed: Annotated[int, typer.Option(help="Seed of the samples.")] = 0,
    table: TableOption = None,
    as_object: JsonOption = False,
) -> None:
    """Search velocities (a, b) in [0, 1] x [0, 1] for orbits of three equal bodies.

    They start at (-1, 0), (1, 0) and (0, 0) with velocities (a, b), (a, b) and (-2a, -2b).
    With --table, nothing is lost if the search is interrupted: the same command resumes it.
    """
    with screen("searching", as_object) as out:
        plane = orbits.search_plane(samples, longest=longest, seed=seed, path=table)
        if as_object:
            out.result({"families": plane.families(), "orbits": _rows(plane)})
        else:
            _print(plane, out)
        if not len(plane.found):
            raise typer.Exit(NOT_FOUND)


def _rows(plane: "orbits.discovery.plane.Plane") -> list[dict]:
    return [
        {
            "a": float(a),
            "b": float(b),
            "period": float(period),
            "word": find.label,
            "scale_free": float(find.invariant),
            "verdict": find.verdict,
            "name": name or None,
        }
        for (a, b, period), find, name in zip(
            plane.starts(), plane.found.finds, plane.names, strict=True
        )
    ]


def _print(plane: "orbits.discovery.plane.Plane", out: Screen) -> None:
    numbers = "{a:11.9f}  {b:11.9f}  {period:13.9f}  {scale_free:13.9f}  {verdict:9}"
    out.print("a            b            period         T |E|^1.5      verdict    word, name")
    for row in sorted(_rows(plane), key=lambda row: row["scale_free"]):
        word = row["word"] if len(row["word"]) <= _WORD else f"{row['word'][:_WORD]}..."
        out.print(f"{numbers.format(**row)}  {word}  {row['name'] or ''}")
    out.print(number_of(plane.families(), "family", "families"))
