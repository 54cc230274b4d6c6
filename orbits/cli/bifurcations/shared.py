"""Common parts of the commands that begin at an equilibrium."""

from typing import Annotated

import typer

import jaxdyn
from jaxdyn._text import fail
from orbits.cli.shared import numbers

StartOption = Annotated[
    str | None,
    typer.Option(metavar="A,B,..", help="State near an equilibrium; the scene's start by default."),
]


def rest_start(name: str, values: dict, start: str | None) -> list[float]:
    """The state near which an equilibrium is sought."""
    if start is not None:
        return list(numbers("--start", start))
    return jaxdyn.scenes.catalogue.entries()[name].make(**values).y0.tolist()


def bounds(option: str, text: str) -> tuple[float, float]:
    """The two bounds in A,B."""
    found = numbers(option, text)
    if not (len(found) == 2 and found[0] < found[1]):
        raise fail(option, "two bounds, the lower one first", repr(text))
    return found[0], found[1]
