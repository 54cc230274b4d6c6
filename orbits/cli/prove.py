"""The command `orbits prove`: a certificate that the orbit of a file exists."""

from typing import Annotated

import typer

import orbits
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import JsonOption
from orbits.cli.shared import NOT_FOUND, OrbitFile, SaveOption, print_and_save


def prove_command(
    file: OrbitFile,
    digits: Annotated[int, typer.Option(help="Decimal digits of the enclosures, roughly.")] = 30,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
) -> None:
    """Prove that the orbit of a file exists, is locally unique, and is stable or unstable."""
    with screen(f"proving the orbit of {file}", as_object) as out:
        orbit, _ = orbits.load(file)
        proof = orbits.prove(orbit, digits)
        print_and_save(proof, save_to, as_object, out)
        if not proof.proved:
            raise typer.Exit(NOT_FOUND)
