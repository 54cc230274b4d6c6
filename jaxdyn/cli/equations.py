"""The command `jaxdyn equations`: the equations of motion of a scene, and its rate as code."""

from typing import Annotated

import typer
from rich.text import Text

import jaxdyn
from jaxdyn._text import choice, fail
from jaxdyn.cli import completion
from jaxdyn.cli.docstrings import scene_settings
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import JsonOption, SceneArgument, SetOption


def equations_command(
    name: SceneArgument,
    settings: SetOption = None,
    latex: Annotated[bool, typer.Option("--latex", help="In LaTeX.")] = False,
    language: Annotated[
        str | None,
        typer.Option(
            "--code",
            metavar="LANGUAGE",
            help="The rate as a function in python, numpy, javascript, c or julia.",
            autocompletion=completion.language,
        ),
    ] = None,
    as_object: JsonOption = False,
) -> None:
    """Print the equations of motion of a scene, its constraints and energies, as a textbook does.

    A parameter that is 0 is left out: --set drag=0.1 shows the drag.
    """
    if latex + (language is not None) + as_object > 1:
        got = "several of them"
        raise fail("--latex", "one of --latex, --code and --json", got, "Run it once for each.")
    if language is not None:
        choice("--code", language, completion.LANGUAGES)
    chosen = scene_settings(name, settings)
    with screen(f"deriving the equations of {name}", as_object) as out:
        scene = jaxdyn.scenes.catalogue.build(name, chosen)
        if language is not None:
            out.print(Text(jaxdyn.symbolic.code(scene, language).rstrip()))
            return
        found = jaxdyn.equations(scene)
        if as_object:
            out.result({part.name: _as_json(found, part.name) for part in found.sections})
        else:
            out.print(Text(found.latex() if latex else found.text()))


def _as_json(found: "jaxdyn.symbolic.Equations", part: str) -> dict:
    title, *lines = found.text(part).splitlines()
    return {"title": title, "text": [x.strip() for x in lines], "latex": found.latex(part)}
