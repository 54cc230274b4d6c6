"""Common parts of the commands of `orbits`: parsing, progress, failures, files."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

import jaxdyn
import orbits
from jaxdyn import _arithmetic as arithmetic
from jaxdyn._text import brief, fail, whole
from jaxdyn.cli.docstrings import scene_settings
from jaxdyn.cli.screen import Screen
from jaxdyn.cli.shared import numbers as numbers
from jaxdyn.cli.shared import output_option, read
from jaxdyn.files.output_files import writable

NOT_FOUND = 1  # exit code: no orbit was found
_FRAMES = 180

OrbitFile = Annotated[Path, typer.Argument(help="An orbit file written by --save.", callback=read)]
SceneOfFile = Annotated[
    str | None,
    typer.Option(
        "--scene", metavar="SCENE", help="For a file of a scene of yours: FILE.py:NAME, or FILE.py."
    ),
]
QuantityOption = Annotated[
    str | None,
    typer.Option(
        metavar="WHAT",
        help="To draw: period, energy, jacobi, multiplier, amplitude x, max x, mean x, phase x.",
    ),
]
SaveOption = Annotated[Path | None, output_option(writable, "Write a file (.json).", "--save")]


def scene_of_file(name: str | None, settings: list[str] | None) -> "jaxdyn.Scene | None":
    """The scene of the user, by --scene and --set, for an orbit file without its functions."""
    if name is None:
        if settings:
            raise fail("--set", "none without --scene", ", ".join(settings))
        return None
    return jaxdyn.scenes.catalogue.build(name, scene_settings(name, settings))


def printer(screen: Screen) -> Callable[["orbits.shooting.newton.Iteration"], None]:
    """A callback that prints a line for each step of Newton's method."""

    def report(step: "orbits.shooting.newton.Iteration") -> None:
        screen.print(
            f"  step {step.index:2d}   largest error {step.residual:9.2e}   "
            f"period {brief(step.period, digits=13):<14}   moved {step.step:.1e}"
        )

    return report


def setting(option: str, text: str, example: str) -> tuple[str, float]:
    """The name and the value in NAME=LEVEL."""
    name, equals, value = text.partition("=")
    try:
        if not equals:
            raise ValueError
        return name.strip(), arithmetic.value(value)
    except ValueError:
        raise fail(option, f"NAME=LEVEL, such as {example}", repr(text)) from None


def bounds(option: str, text: str | None) -> tuple[float, float]:
    """The two bounds in A,B; -inf and inf without a text."""
    if text is None:
        return -math.inf, math.inf
    found = numbers(option, text)
    if not (len(found) == 2 and found[0] < found[1]):
        raise fail(option, "two bounds, the lower one first", repr(text))
    return found[0], found[1]


def grid(option: str, texts: list[str] | None) -> dict[str, list[float]]:
    """The values of each name in NAME=VALUE or NAME=A:B:N."""
    found = {}
    for text in texts or ():
        name, equals, values = text.partition("=")
        parts = values.split(":")
        try:
            if not equals or len(parts) not in (1, 3):
                raise ValueError
            ends = [arithmetic.value(part) for part in parts[:2]]
            count = int(parts[2]) if len(parts) == 3 else 1
        except ValueError:
            raise fail(option, "NAME=VALUE or NAME=A:B:N", repr(text)) from None
        n = whole(option, count)
        step = (ends[-1] - ends[0]) / max(n - 1, 1)
        found[name.strip()] = [ends[0] + i * step for i in range(n)]
    return found


def not_found(
    orbit: "orbits.Orbit",
    remedy: str,
    more: dict,
    as_object: bool,
    screen: Screen,
    stage: str = "",
) -> typer.Exit:
    """Print why there is no orbit, optionally as JSON with further entries; return the exit.

    The remedy replaces that of the outcome, which names arguments of Python functions.
    """
    message = f"{orbit.cause} {remedy}"
    if as_object:
        best = {"period": orbit.period, "y0": orbit.y0, "largest_error": orbit.residual}
        failure = {"outcome": orbit.outcome.name, "message": message, "best_iterate": best}
        screen.result(failure | more)
    screen.print(f"[red]no orbit[/red]{stage and f' ({stage})'}: {message}")
    return typer.Exit(NOT_FOUND)


def draw(
    found: Sequence["orbits.Orbit"],
    titles: Sequence[str],
    plot: Path | None,
    animate: Path | None,
    screen: Screen,
    title: str | None = None,
) -> None:
    """Draw orbits, and animate the last one, if requested."""
    if plot:
        with screen.writing(plot, "drawn in"):
            orbits.drawing.orbits(found, plot, titles, title=title)
    if animate:
        with screen.writing(animate, "animated in"):
            motion = jaxdyn.simulate(found[-1].scene, samples=_FRAMES)
            jaxdyn.drawing.animate(motion, animate)
