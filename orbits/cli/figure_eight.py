"""The command `orbits figure-eight`: the textbook's eight, and the neighbour that closes first."""

import json
import time
from typing import Annotated, Any

import jax
import typer
from rich.console import Console

from jaxdyn._checks import fail
from jaxdyn.cli.shared import AnimateOption, JsonOption, PlotOption
from jaxdyn.scenes import EIGHT_GUESS, EIGHT_GUESS_PERIOD
from orbits.cli.printed import print_reports
from orbits.cli.shared import (
    NOT_FOUND,
    SaveOption,
    check_files,
    draw,
    failure,
    numbers,
    progress,
)
from orbits.figure_eight import figure_eight
from orbits.problem import Orbit
from orbits.report import as_json, report
from orbits.verify import save

NumbersOption = Annotated[str | None, typer.Option(metavar="A,B,...")]


def figure_eight_command(
    plot: PlotOption = None,
    animate: AnimateOption = None,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
    guess: NumbersOption = None,
    period: Annotated[float, typer.Option(help="Guess of the period.")] = EIGHT_GUESS_PERIOD,
    masses: NumbersOption = None,
    lower: NumbersOption = None,
    upper: NumbersOption = None,
) -> None:
    """Montgomery's figure-eight from a rough guess, and the neighbour that closes first.

    The guess has 12 numbers x1,y1,x2,y2,x3,y3,vx1,vy1,...; the bounds --lower and --upper
    have 13, the last for the period.
    """
    console = Console(stderr=as_object, highlight=False, soft_wrap=True)
    check_files(plot, animate, save_to)
    clock = _Clock()
    plain, eight = figure_eight(
        _numbers("guess", guess, list(EIGHT_GUESS)),
        period,
        m=_numbers("masses", masses, [1.0, 1.0, 1.0]),
        lower=_numbers("lower", lower, None),
        upper=_numbers("upper", upper, None),
        say=lambda text: console.print(f"[bold]{text}[/bold]"),
        report=lambda step: console.print(progress(step)),
    )
    if not eight.ok:
        _print_failure(plain, eight, clock, as_object, console)
        raise typer.Exit(NOT_FOUND)
    console.print("[bold]testing both: choreography, stability, a second integrator[/bold]")
    claims = {"closed plainly": report(plain)}
    neighbour = as_json(claims["closed plainly"]) | {"seconds": clock.seconds()}
    claims["choreography"] = report(eight)
    found = as_json(claims["choreography"]) | {"seconds": clock.seconds(), "neighbour": neighbour}
    if not as_object:
        print_reports(claims, console)
        seconds = clock.seconds()
        console.print(f"compiling {seconds['compile']:.1f} s, the rest {seconds['solve']:.1f} s")
    if save_to:
        save(save_to, eight, claims["choreography"])
        console.print(f"saved to {save_to}")
    titles = ["closed plainly", "closed as a choreography"]
    draw([plain, eight], titles, plot, animate, console)
    if as_object:  # last: a file that cannot be written leaves no result behind
        print(json.dumps(found))  # noqa: T201


class _Clock:
    """Wall-clock seconds since it was made, and how many of them went into compiling."""

    def __init__(self):
        self.start, self.compiling = time.perf_counter(), 0.0
        jax.monitoring.register_event_duration_secs_listener(self._listen)

    def _listen(self, event: str, duration_secs: float, **_: Any) -> None:
        if event.startswith("/jax/core/compile/"):
            self.compiling += duration_secs

    def seconds(self) -> dict[str, float]:
        total = time.perf_counter() - self.start
        return {"compile": round(self.compiling, 3), "solve": round(total - self.compiling, 3)}


def _numbers(name: str, text: str | None, default: list[float] | None) -> list[float] | None:
    if text is None:
        return default
    values = numbers(name, text)
    if default is not None and len(values) != len(default):
        raise fail(name, f"{len(default)} numbers", f"{len(values)}")
    return values


def _print_failure(plain: Orbit, eight: Orbit, clock: _Clock, as_object: bool, console) -> None:
    stage = "plain closing" if not plain.ok else "choreography"
    if as_object:
        about = {"stage": stage, "seconds": clock.seconds()}
        print(json.dumps(failure(eight) | about))  # noqa: T201
    console.print(f"[red]no orbit[/red] ({stage}): {eight.message}")
