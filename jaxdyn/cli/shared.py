"""What the command lines of `jaxdyn` and `orbits` share: options, how they begin and end."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from jaxdyn._config import configure

MISUSE = 2  # exit code: the input makes no sense
#: What a wrong option or argument raises; typer exports only a kind of it.
_Usage: type[Exception] = typer.BadParameter.__bases__[0]

SceneArgument = Annotated[str, typer.Argument(metavar="SCENE", help="A scene of `jaxdyn list`.")]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="One of its numbers.")
]
SpanOption = Annotated[float | None, typer.Option(help="End of the span; the scene's own.")]
PlotOption = Annotated[Path | None, typer.Option(help="Draw it (.png, .pdf, .svg).")]
AnimateOption = Annotated[Path | None, typer.Option(help="Animate it (.gif, .mp4).")]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")]


def application(about: str) -> typer.Typer:
    """A command line without commands yet; called without one, it shows its help."""
    app = typer.Typer(help=about, add_completion=False, pretty_exceptions_enable=False)
    app.callback(invoke_without_command=True)(_begin)
    return app


def _begin(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit(MISUSE)
    configure()


def run(app: typer.Typer) -> None:
    """Run a command line; one line and exit code 2 for input that makes no sense."""
    try:
        code = app(standalone_mode=False)
    except _Usage as error:
        _refuse(f"{error.format_message()} See --help.")
    except ValueError as error:
        _refuse(str(error))
    else:
        raise SystemExit(code or 0)


def _refuse(message: str) -> None:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)  # noqa: T201
    raise SystemExit(MISUSE) from None
