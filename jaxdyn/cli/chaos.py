"""The command `jaxdyn chaos`: Lyapunov exponents of a motion, or a map of chaotic motions."""

from typing import Annotated, NamedTuple

import typer
from rich.markup import escape

import jaxdyn
from jaxdyn._arithmetic import value
from jaxdyn._text import fail, whole
from jaxdyn.cli.docstrings import scene_settings
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import (
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    SpanOption,
    TitleOption,
    check_title,
    number,
)

STOPPED = 1  # exit code: the motion did not reach its end
_MOST_VALUES = 1000  # of a map, in each direction


class _Range(NamedTuple):
    """A number that a map varies: its name and its range."""

    name: str
    low: float
    high: float


def chaos_command(
    name: SceneArgument,
    settings: SetOption = None,
    t1: SpanOption = None,
    transient: Annotated[
        float | None, number("Time to skip at the start; a tenth of the span.")
    ] = None,
    ranges: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="NAME=LOW:HIGH",
            help="Map the MEGNO over this number; give two, the second is horizontal.",
        ),
    ] = None,
    size: Annotated[int, typer.Option(help="Number of values in each direction of a map.")] = 40,
    plot: PlotOption = None,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """Lyapunov exponents of a motion with error bars, or a map of regular and chaotic motions.

    A map varies parameters of the scene or entries of its initial state.
    """
    check_title(title, plot)
    chosen, varied = scene_settings(name, settings), _ranges(ranges)
    if varied:
        whole("size", size, least=2, most=_MOST_VALUES)
        if transient is not None:
            raise fail("--transient", "none with --map", transient, "A map shows whole motions.")
    elif plot is not None:
        raise fail("--plot", "--map with it", "none", "A spectrum is a few numbers.")
    with screen(f"following tangents of {name}", as_object) as out:
        if varied:
            found, labels = _map(name, chosen, varied, size, t1, out)
            if plot:
                with out.writing(plot, "drawn in"):
                    jaxdyn.drawing.chaos_map(found, plot, names=labels, title=title or name)
            return
        scene = jaxdyn.scenes.catalogue.build_smooth(name, chosen, t1)
        found = jaxdyn.lyapunov_exponents(scene, t1, transient=transient, throw=False)
        if as_object:
            out.result({"scene": name} | found.as_dict())
        else:
            out.print(f"[bold]{name}[/bold]:")
            out.print(escape(repr(found).partition("\n")[2]))
        if not found.ok:
            raise typer.Exit(STOPPED)


def _ranges(texts: list[str] | None) -> tuple[_Range, ...]:
    if not texts:
        return ()
    if len(texts) != 2:
        raise fail("--map", "two of them, NAME=LOW:HIGH each", len(texts))
    return tuple(_range(text) for text in texts)


def _range(text: str) -> _Range:
    name, equals, ends = text.partition("=")
    low, colon, high = ends.partition(":")
    if not (equals and colon):
        raise fail("--map", "NAME=LOW:HIGH", repr(text))
    found = _Range(name.strip(), value(low), value(high))
    if found.low == found.high:
        raise fail("--map", "two different ends", repr(text))
    return found


def _map(
    name: str,
    chosen: dict[str, str],
    varied: tuple[_Range, ...],
    size: int,
    t1: float | None,
    out: Screen,
) -> "tuple[jaxdyn.chaos.ChaosMap, list[str]]":
    """Print a map; returns it, and its two numbers with their units."""
    jaxdyn.scenes.catalogue.build_smooth(name, chosen, t1)
    make, labels = jaxdyn.scenes.catalogue.function_of_numbers(
        name, chosen, [one.name for one in varied]
    )
    first, second = (_grid(one, size) for one in varied)
    found = jaxdyn.chaos.chaos_map(make, first, second, t1)
    if out.as_object:
        out.result({"scene": name, "names": labels} | found.as_dict())
        return found, labels
    motions, chaotic = int(found.ok.sum()), int(found.chaotic.sum())
    out.print(f"[bold]{name}[/bold], {motions} motions over {' and '.join(map(escape, labels))}:")
    out.print(f"  {chaotic} chaotic, with a mean MEGNO above {found.CHAOTIC:g}")
    out.print(f"  {motions - chaotic} regular, or chaotic too slowly for this span")
    if motions < size * size:
        out.print(f"  {size * size - motions} that do not exist, or failed")
    return found, labels


def _grid(one: _Range, size: int) -> list[float]:
    return [one.low + (one.high - one.low) * i / (size - 1) for i in range(size)]
