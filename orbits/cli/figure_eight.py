"""The command `orbits figure-eight`: Montgomery's figure-eight, and its neighbour."""

import time
from typing import Annotated, Any

import typer

import jaxdyn
import orbits
from jaxdyn._text import fail
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import (
    BEGAN,
    AnimateOption,
    JsonOption,
    PlotOption,
    TitleOption,
    check_title,
    number,
)
from orbits.cli.printed import print_reports
from orbits.cli.shared import SaveOption, draw, not_found, numbers, printer

_TITLES = ("closed plainly", "closed as a choreography")
_REMEDY = "Give another --guess or --period, or other bounds with --lower and --upper."


def _numbers_option(text: str) -> Any:
    return typer.Option(metavar="A,B,...", help=text)


def figure_eight_command(
    plot: PlotOption = None,
    title: TitleOption = None,
    animate: AnimateOption = None,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
    guess: Annotated[
        str | None, _numbers_option("Guess of the start: x1,y1,x2,y2,x3,y3,vx1,vy1,...")
    ] = None,
    period: Annotated[float | None, number("Guess of the period; 8 by default.")] = None,
    masses: Annotated[str | None, _numbers_option("The three masses; 1,1,1 by default.")] = None,
    lower: Annotated[
        str | None, _numbers_option("Lower bounds of the start, then of the period.")
    ] = None,
    upper: Annotated[
        str | None, _numbers_option("Upper bounds of the start, then of the period.")
    ] = None,
) -> None:
    """Montgomery's figure-eight from a rough guess, and the neighbour that plain closing finds.

    The guess has 12 numbers x1,y1,x2,y2,x3,y3,vx1,vy1,...; the bounds --lower and --upper
    have 13, the last for the period.
    """
    check_title(title, plot)
    start = _numbers("--guess", guess, 12)
    lows, highs = _numbers("--lower", lower, 13), _numbers("--upper", upper, 13)
    m = _numbers("--masses", masses, 3) or [1.0, 1.0, 1.0]
    with screen("closing the motion of three bodies", as_object) as out:
        clock = jaxdyn.accuracy.timing.Clock()
        plain, eight = orbits.figure_eight(
            start or list(jaxdyn.scenes.EIGHT_GUESS),
            jaxdyn.scenes.EIGHT_GUESS_PERIOD if period is None else period,
            m=m,
            lower=lows,
            upper=highs,
            say=lambda text: out.print(f"[bold]{text}[/bold]"),
            report=printer(out),
        )
        if not eight.ok:
            stage = "plain closing" if not plain.ok else "choreography"
            more = {"stage": stage, "seconds": _seconds(clock)}
            raise not_found(eight, _REMEDY, more, as_object, out, stage)
        testing = "testing both: choreography, stability, a second integrator"
        out.print(f"[bold]{testing}[/bold]")
        out.show_task(testing)
        first = orbits.report(plain)
        neighbour = orbits.analysis.as_json(first) | {"seconds": _seconds(clock)}
        claims = {"closed plainly": first, "choreography": orbits.report(eight)}
        if as_object:
            found = orbits.analysis.as_json(claims["choreography"])
            out.result(found | {"seconds": _seconds(clock), "neighbour": neighbour})
        else:
            print_reports(claims, out, eight)
        if save_to:
            with out.writing(save_to, "saved to"):
                orbits.save(save_to, eight, claims["choreography"])
        drawing = jaxdyn.accuracy.timing.Clock()
        draw([plain, eight], _TITLES, plot, animate, out, title)
        if not as_object:
            _print_seconds(clock, drawing, out)


def _seconds(clock: "jaxdyn.accuracy.timing.Clock") -> dict[str, float]:
    compiling = clock.compiling
    return {"compile": round(compiling, 3), "solve": round(clock.seconds - compiling, 3)}


def _print_seconds(
    clock: "jaxdyn.accuracy.timing.Clock", drawing: "jaxdyn.accuracy.timing.Clock", out: Screen
) -> None:
    """Print the time that the whole command took since it began to load."""
    total, drawn = time.perf_counter() - BEGAN, drawing.seconds - drawing.compiling
    parts = {
        "loading": total - clock.seconds,
        "compiling": clock.compiling,
        "drawing": drawn,
        "the rest": clock.seconds - clock.compiling - drawn,
    }
    said = ", ".join(f"{part} {seconds:.1f} s" for part, seconds in parts.items())
    out.print(f"{total:.1f} s: {said}")


def _numbers(option: str, text: str | None, count: int) -> list[float] | None:
    """The `count` numbers in A,B,...; None without text."""
    if text is None:
        return None
    values = numbers(option, text)
    if len(values) != count:
        raise fail(option, f"{count} numbers", len(values))
    return values
