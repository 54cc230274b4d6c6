"""The command `orbits refine`: an orbit of a file to many digits."""

from pathlib import Path
from typing import Annotated

import typer

import orbits
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import JsonOption, read
from orbits.cli.shared import SaveOption


def refine_command(
    file: Annotated[Path, typer.Argument(help="An orbit file written by --save.", callback=read)],
    digits: Annotated[int, typer.Option(help="Decimal digits, 15 to 1000.")] = 50,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
) -> None:
    """Start, period and multipliers of an orbit to many digits."""
    with screen(f"refining the orbit of {file}", as_object) as out:
        orbit, _ = orbits.load(file)
        found = orbits.refine(orbit, digits)
        if as_object:
            out.result(found.as_json())
        out.print(str(found))
        if save_to:
            with out.writing(save_to, "saved in"):
                orbits.save(save_to, found)
