"""Options that the commands of `jaxdyn` and `orbits` share."""

from pathlib import Path
from typing import Annotated

import typer

SceneArgument = Annotated[str, typer.Argument(metavar="SCENE", help="A scene of `jaxdyn list`.")]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="One of its numbers.")
]
SpanOption = Annotated[float | None, typer.Option(help="End of the span; the scene's own.")]
PlotOption = Annotated[Path | None, typer.Option(help="Draw it (.png, .pdf, .svg).")]
AnimateOption = Annotated[Path | None, typer.Option(help="Animate it (.gif, .mp4).")]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")]
