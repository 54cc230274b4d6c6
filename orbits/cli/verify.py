"""The command `orbits verify`: derives every claim of an orbit file again."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from jaxdyn._checks import fail
from jaxdyn.cli.shared import JsonOption
from orbits.cli.printed import print_reports
from orbits.evidence import digits
from orbits.report import as_json
from orbits.verify import load, verify


def verify_command(
    file: Annotated[Path, typer.Argument(help="An orbit file written by --save.")],
    as_object: JsonOption = False,
) -> None:
    """Derive every claim of an orbit file again, from its scene, start and period alone."""
    console = Console(stderr=as_object, highlight=False, soft_wrap=True)
    derived, mismatches = verify(file)
    if as_object:
        wrong = [{"name": m.name, "claimed": m.claimed, "derived": m.derived} for m in mismatches]
        print(json.dumps({"ok": not wrong, "mismatches": wrong, "derived": as_json(derived)}))  # noqa: T201
    else:
        print_reports({file.name: derived}, console)
    if mismatches:
        first = mismatches[0]
        raise fail(
            str(file),
            f"claims that hold, {first.name} = {first.derived}",
            f"{first.claimed}",
            f"These do not hold: {', '.join(m.name for m in mismatches)}. The file was edited.",
        )
    standing = digits(load(file)[0])
    console.print(
        f"every claim of the file holds; by another integrator {standing.period:.1f} digits of the "
        f"period and {standing.y0:.1f} of the start may be claimed"
    )
