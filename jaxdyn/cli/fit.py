"""The command `jaxdyn fit`: parameters and initial state of a scene from measurements."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

import jaxdyn
from jaxdyn._text import brief, choice, fail, number_of
from jaxdyn.cli.docstrings import parameter_name, scene_settings
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import (
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    TitleOption,
    check_title,
    number,
    read,
)

FAILED = 1  # exit code: no estimates
_GUESSED_BADLY = ("NOT_CONVERGED", "NO_MOTION")  # statuses for which another guess may help

IntervalOption = Annotated[
    str | None,
    typer.Option(
        metavar="confidence|prediction",
        help="Bands of the picture: confidence, or prediction as well.",
    ),
]


def fit_command(
    name: SceneArgument,
    data: Annotated[
        Path, typer.Argument(metavar="TABLE", callback=read, help="A text file with a column t.")
    ],
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="NAME[=GUESS]",
            help="A parameter to estimate, from its value in the scene or from a guess.",
        ),
    ] = None,
    settings: SetOption = None,
    start: Annotated[
        list[str] | None,
        typer.Option(
            "--start",
            metavar="NAME",
            help="An entry of the start to estimate; all, if no free number changes the start.",
        ),
    ] = None,
    column: Annotated[
        list[str] | None, typer.Option("--column", metavar="NAME", help="A column to use.")
    ] = None,
    noise: Annotated[
        float | None, number("Standard deviation of the measurements; estimated by default.")
    ] = None,
    segments: Annotated[int | None, typer.Option(help="Number of segments of the motion.")] = None,
    interval: IntervalOption = None,
    plot: PlotOption = None,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """Estimate parameters and the start of a scene from measurements, with 95 % intervals."""
    check_title(title, plot)
    _check_interval(interval, plot)
    model = _check(name, free or [], scene_settings(name, settings))
    with screen(f"fitting {name}", as_object) as out:
        make, guess = model()
        found = jaxdyn.fit(
            make,
            guess,
            jaxdyn.read_csv(data),
            start=start or None,
            columns=column or None,
            noise=noise,
            segments=segments,
            throw=False,
        )
        if as_object:
            out.result({"scene": name} | found.as_dict())
        else:
            _print(found, out)
            if found.status.name in _GUESSED_BADLY:
                out.print(escape(_other_guess(found, guess)))
        if plot and found.ok:
            with out.writing(plot, "drawn in"):
                found.plot(plot, interval=interval or "confidence", title=title)
        if not found.ok:
            raise typer.Exit(FAILED)


def _check_interval(interval: str | None, plot: Path | None) -> None:
    if interval is not None:
        choice("--interval", interval, ("confidence", "prediction"))
        if plot is None:
            raise fail("--interval", "--plot with it", "none", "It is a band of the picture.")


def _check(name: str, free: list[str], chosen: dict[str, str]) -> Callable[[], tuple]:
    """A function that returns the scene as a function of the free numbers, and their guesses."""
    if not free:
        raise fail("--free", "a number to be estimated", "none", "For example --free g.")
    guessed = scene_settings(name, [text for text in free if "=" in text])
    names = [parameter_name("--free", text.partition("=")[0], name) for text in free]
    for one in names:
        if one in chosen:
            fixed = f"{one}={chosen[one]}"
            remedy = f"To begin with that guess, write --free {fixed} alone."
            raise fail(
                f"--free {one}", "a number that --set does not fix", f"--set {fixed}", remedy
            )

    def model():
        catalogue = jaxdyn.scenes.catalogue
        entry = catalogue.entry(name)
        guess = {one: entry.parameters[choice("parameter", one, entry.parameters)] for one in names}
        make = functools.partial(entry.make, **catalogue.numbers(name, chosen))
        return make, guess | catalogue.numbers(name, guessed)

    return model


def _print(found: "jaxdyn.fitting.Fit", out: Screen) -> None:
    out.print(escape(repr(found)))


def _other_guess(found: "jaxdyn.fitting.Fit", guess: dict) -> str:
    """Where a fit without estimates began, and how to begin elsewhere."""
    began = ", ".join(f"{name} = {_numbers(x)}" for name, x in guess.items())
    segments = number_of(len(found.segments.begin), "segment")
    options = [
        f"--free {name}={'A,B,...' if isinstance(x, tuple) else 'A'}" for name, x in guess.items()
    ]
    return (
        f"It began at {began}, with {segments}. To begin nearer to the data: {' '.join(options)}; "
        "for more segments: --segments N."
    )


def _numbers(x) -> str:
    return ",".join(map(brief, x)) if isinstance(x, tuple) else brief(x)
