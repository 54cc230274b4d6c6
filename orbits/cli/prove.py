"""The command `orbits prove`: a certificate that the orbit of a file exists."""

from pathlib import Path
from typing import Annotated

import typer

import orbits
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import JsonOption, read
from orbits.cli.shared import NOT_FOUND, SaveOption


def prove_command(
    file: Annotated[Path, typer.Argument(help="An orbit file written by --save.", callback=read)],
    digits: Annotated[int, typer.Option(help="Decimal digits of the enclosures, about.")] = 30,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
) -> None:
    """Prove that the orbit of a file exists, is locally unique, and is stable or unstable."""
    with screen(f"proving the orbit of {file}", as_object) as out:
        orbit, _ = orbits.load(file)
        proof = orbits.prove(orbit, digits)
        if as_object:
            out.result(proof.as_json())
        out.print(str(proof))
        if save_to:
            with out.writing(save_to, "saved in"):
                orbits.save(save_to, proof)
        if not proof.proved:
            raise typer.Exit(NOT_FOUND)
