"""Common parts of the commands of `jaxdyn` and `orbits`: options, start, exit codes.

Neither this file nor that of a command loads JAX, NumPy or Matplotlib, so help and usage errors
appear at once. A command uses names of the two packages, which load these libraries when needed.
"""

import gc
import io
import os
import sys
import tempfile
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

import jaxdyn
from jaxdyn import _scene_files
from jaxdyn._arithmetic import remedy as remedy_for
from jaxdyn._arithmetic import value
from jaxdyn._text import fail
from jaxdyn.cli import completion, docstrings
from jaxdyn.cli.messages import in_options, settings_of
from jaxdyn.files.input_files import MAX_BYTES, content
from jaxdyn.files.output_files import animation_path, page_path, picture_path

MISUSE = 2  # exit code: invalid input
BEGAN = time.perf_counter()  # when the command line began to load: libraries take a second or more
FAILED = 1  # exit code: what was sought is not found
INTERRUPTED = 130  # exit code: Ctrl-C, as in shells
PIPE_CLOSED = 1  # exit code: the reader has closed the pipe; the same as Typer's
_RARELY = 100_000, 20, 50  # thresholds of the garbage collector for its three generations
#: Raised for a wrong option or argument; typer exports only a subclass.
_Usage: type[Exception] = typer.BadParameter.__bases__[0]


def output_option(check: Callable[[Path, str], object], about: str, *names: str) -> Any:
    """An option for a file to write, which is checked when the arguments are parsed."""

    def checked(option: typer.CallbackParam, path: Path | None) -> Path | None:
        if path is not None:
            check(path, option.opts[0])
        return path

    return typer.Option(*names, callback=checked, help=about)


def read(option: typer.CallbackParam, path: Path | None) -> Path | None:
    """The callback of an option or argument for a file to read, which refuses unreadable files."""
    if path is not None:
        content(path, MAX_BYTES, "Give the path of a file that is there.", option.opts[0])
    return path


def number(about: str) -> Any:
    """An option for a number, which may be arithmetic: ``2*pi/60``."""

    def checked(text: str | float) -> float:
        try:
            return value(text) if isinstance(text, str) else text  # a default is not a string
        except ValueError as error:
            raise typer.BadParameter(str(error).removeprefix("number: ")) from None

    return typer.Option(parser=checked, metavar="NUMBER", help=about)


SceneArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="A scene of `jaxdyn list`; FILE.py:NAME, a function of yours that returns one; or "
        "FILE.ode, equations as text.",
        autocompletion=completion.scene,
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="One of its parameters, such as angle=pi/2.",
        autocompletion=completion.setting,
    ),
]
SpanOption = Annotated[float | None, number("End of the time span; that of the scene.")]
PlotOption = Annotated[Path | None, output_option(picture_path, "Draw it (.png, .pdf, .svg).")]
HertzOption = Annotated[
    bool, typer.Option("--hertz", help="All frequencies in Hz, those of --within as well.")
]
SeriesOption = Annotated[
    Path | None, output_option(picture_path, "Draw its state over time (.png, .pdf, .svg).")
]
EnergiesOption = Annotated[
    Path | None, output_option(picture_path, "Draw its energies over time (.png, .pdf, .svg).")
]
AnimateOption = Annotated[Path | None, output_option(animation_path, "Animate it (.gif, .mp4).")]
SecondsOption = Annotated[float | None, number("How long the animation lasts [s].")]
FreeBodyOption = Annotated[
    Path | None,
    output_option(picture_path, "Draw free-body diagrams (.png, .pdf, .svg)."),
]
AtOption = Annotated[float | None, number("Time of the free-body diagrams [s]; the start.")]
TitleOption = Annotated[str | None, typer.Option(help="Title of the picture.")]
PlayOption = Annotated[bool, typer.Option("--play", help="Open a page that plays it.")]
LiveOption = Annotated[
    Path | None, output_option(page_path, "Write a page on which it runs, with sliders (.html).")
]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")]


def check_title(title: str | None, *pictures: Path | None, options: str = "--plot") -> None:
    """Raise ValueError for a title without a picture."""
    if title is not None and not any(pictures):
        raise fail("--title", f"{options} with it", "none", "It is the title of the picture.")


def numbers(option: str, text: str) -> list[float]:
    """The numbers in A,B,..."""
    try:
        return [value(part) for part in text.split(",")]
    except ValueError:
        remedy = remedy_for(text)
        raise fail(option, "comma-separated numbers", repr(text), remedy) from None


def open_page(page: "jaxdyn.player.PlayerPage", name: str) -> str:
    """Write a page to a folder of temporary files and open it in the browser; say where it is."""
    path = Path(tempfile.mkdtemp(prefix="jaxdyn-")) / f"{name}.html"
    path.write_text(page.text, encoding="utf-8")
    return f"{'opened' if webbrowser.open(path.as_uri()) else 'no browser: open'} {path}"


def application(about: str) -> typer.Typer:
    """A command line without commands yet; without arguments it shows its help."""
    # Rich's markup would take a unit such as [m/s] for a tag.
    app = typer.Typer(help=about, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.callback(invoke_without_command=True)(_begin)
    return app


def add(app: typer.Typer, name: str, command: Callable[..., None], *examples: str) -> None:
    """Add a command, whose help ends with the given examples."""
    lines = "\n".join(f"  {example}" for example in examples)
    # Text after a backspace is not wrapped.
    app.command(name, epilog=f"\b\nExamples:\n{lines}")(command)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(jaxdyn.__version__)
        raise typer.Exit


def _begin(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    del version
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit(MISUSE)


def start(app: typer.Typer) -> None:
    """Run a command line; one line on standard error and an exit code for what fails.

    The code is 2 for invalid input, and 1 where nothing is found.
    """
    # Most objects that imports and traces make stay alive; searching them for cycles repeatedly
    # takes a tenth of the time of a short command. A library must leave this setting to its user,
    # but this process is ours.
    gc.set_threshold(*_RARELY)
    if sys.stderr is None:  # closed by the caller
        sys.stderr = open(os.devnull, "w", encoding="utf-8")
    if sys.stdout is None:
        _refuse("standard output is closed. Write to a file, or to /dev/null.")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal may support fewer characters
            stream.reconfigure(errors="replace")
    try:
        with _scene_files.locate_errors():
            code = app(standalone_mode=False)
        if sys.stdout is not None:
            sys.stdout.flush()
    except _Usage as error:
        said = error.format_message().rstrip(".")
        _refuse(f"{said}{'' if said.endswith('?') else '.'} See --help.")
    except ValueError as error:
        _refuse(_in_options(app, error))
    except typer.Abort:
        raise SystemExit(INTERRUPTED) from None
    except RuntimeError as error:
        # Raised by a search or an integration that fails; others are errors of this program.
        if not type(error).__module__.startswith(("jaxdyn.", "orbits.")):
            raise
        _refuse(_in_options(app, error), FAILED)
    except BrokenPipeError:
        _let_go()
        raise SystemExit(PIPE_CLOSED) from None
    except OSError as error:
        _let_go()
        _refuse(f"{error.filename or 'standard output'}: {error.strerror or error}.")
    else:
        raise SystemExit(code or 0)
    finally:
        # Otherwise Python would search all live objects for cycles once more at exit, in 0.4 s.
        gc.freeze()


def _in_options(app: typer.Typer, error: Exception) -> str:
    """The message of an error, in the words of the command that was run."""
    name, *arguments = sys.argv[1:]
    command = getattr(typer.main.get_command(app), "commands", {}).get(name)
    if command is None or _scene_files.is_raised_by(error):
        return str(error)
    zoo = docstrings.scenes()
    parameters = {key for word in arguments if word in zoo for key in zoo[word].parameters}
    options = {option for parameter in command.params for option in parameter.opts}
    return in_options(str(error), options, parameters, settings_of(arguments))


def _let_go() -> None:
    """Detach standard output, which Python would otherwise flush at exit, with an error."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _refuse(message: str, code: int = MISUSE) -> None:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)  # noqa: T201
    raise SystemExit(code) from None
