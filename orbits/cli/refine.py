"""The command `orbits refine`: an orbit of a file to many digits."""

from typing import Annotated

import typer

import orbits
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import JsonOption
from orbits.cli.shared import OrbitFile, SaveOption, print_and_save


def refine_command(
    file: OrbitFile,
    digits: Annotated[int, typer.Option(help="Decimal digits, 15 to 1000.")] = 50,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
) -> None:
    """Start, period and multipliers of an orbit to many digits."""
    with screen(f"refining the orbit of {file}", as_object) as out:
        orbit, _ = orbits.load(file)
        print_and_save(orbits.refine(orbit, digits), save_to, as_object, out)
