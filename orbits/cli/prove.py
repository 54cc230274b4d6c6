"""The commands `orbits prove` and `orbits refine`: a proof that an orbit exists, and its digits."""

from pathlib import Path
from typing import Annotated

import typer

import orbits
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import JsonOption, SetOption
from orbits.cli.shared import NOT_FOUND, OrbitFile, SaveOption, SceneOfFile, scene_of_file


def prove_command(
    file: OrbitFile,
    digits: Annotated[int, typer.Option(help="Decimal digits of the enclosures, roughly.")] = 30,
    scene: SceneOfFile = None,
    settings: SetOption = None,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
) -> None:
    """Prove that the orbit of a file exists, is locally unique, and is stable or unstable."""
    with screen(f"proving the orbit of {file}", as_object) as out:
        orbit, _ = orbits.load(file, scene=scene_of_file(scene, settings))
        proof = orbits.prove(orbit, digits)
        _print_and_save(proof, save_to, as_object, out)
        if not proof.proved:
            raise typer.Exit(NOT_FOUND)


def refine_command(
    file: OrbitFile,
    digits: Annotated[int, typer.Option(help="Decimal digits, 15 to 1000.")] = 50,
    scene: SceneOfFile = None,
    settings: SetOption = None,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
) -> None:
    """Start, period and multipliers of an orbit to many digits."""
    with screen(f"refining the orbit of {file}", as_object) as out:
        orbit, _ = orbits.load(file, scene=scene_of_file(scene, settings))
        _print_and_save(orbits.refine(orbit, digits), save_to, as_object, out)


def _print_and_save(
    found: "orbits.proof.Refined | orbits.proof.Certificate",
    save_to: Path | None,
    as_object: bool,
    out: Screen,
) -> None:
    if as_object:
        out.result(found.as_json())
    out.print(str(found))
    if save_to:
        with out.writing(save_to, "saved to"):
            orbits.save(save_to, found)
