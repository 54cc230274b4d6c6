"""The command line: `orbits figure-eight`, `orbits verify FILE`, `orbits aim`."""

import json
import math
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import jax
import typer
from rich.console import Console
from rich.table import Table

import jaxdyn
from jaxdyn._checks import fail
from jaxdyn.scenes import EIGHT_GUESS, EIGHT_GUESS_PERIOD
from orbits.aim_command import aim_command
from orbits.figure_eight import figure_eight
from orbits.newton import Iteration
from orbits.problem import Orbit
from orbits.report import Report, as_json, report
from orbits.verify import save, verify

app = typer.Typer(
    help="Periodic orbits: find them, identify them, verify them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
NOT_FOUND = 1  # exit code: no orbit was found
MISUSE = 2  # exit code: the input makes no sense

PlotOption = Annotated[Path | None, typer.Option(help="Draw the orbits (.png, .pdf, .svg).")]
AnimateOption = Annotated[Path | None, typer.Option(help="Animate the eight (.gif, .mp4).")]
SaveOption = Annotated[Path | None, typer.Option("--save", help="Write an orbit file (.json).")]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")]
NumbersOption = Annotated[str | None, typer.Option(metavar="A,B,...")]


app.command("aim")(aim_command)


@app.callback()
def _settings() -> None:
    jaxdyn.configure()


@app.command("figure-eight")
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
    _check_files(plot, animate, save_to)
    clock = _Clock()
    plain, eight = figure_eight(
        _numbers("guess", guess, list(EIGHT_GUESS)),
        period,
        m=_numbers("masses", masses, [1.0, 1.0, 1.0]),
        lower=_numbers("lower", lower, None),
        upper=_numbers("upper", upper, None),
        say=lambda text: console.print(f"[bold]{text}[/bold]"),
        report=lambda step: console.print(_progress(step)),
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
        _print_reports(claims, clock, console)
    if save_to:
        save(save_to, eight, claims["choreography"])
        console.print(f"saved to {save_to}")
    _draw(plain, eight, plot, animate, console)
    if as_object:  # last: a file that cannot be written leaves no result behind
        print(json.dumps(found))  # noqa: T201


@app.command("verify")
def verify_command(
    file: Annotated[Path, typer.Argument(help="An orbit file written by --save.")],
    as_object: JsonOption = False,
) -> None:
    """Derive every claim of an orbit file again, from its scene, start and period alone."""
    console = Console(stderr=as_object, highlight=False, soft_wrap=True)
    derived, mismatches = verify(file)
    if as_object:
        wrong = [{"name": m.name, "claimed": m.claimed, "derived": m.derived} for m in mismatches]
        print(json.dumps({"ok": not wrong, "mismatches": wrong, "derived": as_json(derived)}))  # noqa: T201
    else:
        _print_reports({file.name: derived}, None, console)
    if mismatches:
        first = mismatches[0]
        raise fail(
            str(file),
            f"claims that hold, {first.name} = {first.derived}",
            f"{first.claimed}",
            f"These do not hold: {', '.join(m.name for m in mismatches)}. The file was edited.",
        )
    console.print("every claim of the file holds")


def main() -> None:
    """Run the command line; one line and exit code 2 for input that makes no sense."""
    try:
        app()
    except ValueError as error:
        print(f"error: {' '.join(str(error).split())}", file=sys.stderr)  # noqa: T201
        raise SystemExit(MISUSE) from None


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


def _check_files(plot: Path | None, animate: Path | None, save_to: Path | None) -> None:
    """Refuse a file that cannot be written before the work, not after it."""
    if plot or animate:
        from jaxdyn import animate as moving
        from jaxdyn import plots

        for path, suffixes in ((plot, plots.SUFFIXES), (animate, moving.SUFFIXES)):
            if path:
                plots.checked_path(path, suffixes)
    if save_to and (save_to.is_dir() or not save_to.parent.is_dir()):
        raise fail("file", "a file in a folder that exists", f"'{save_to}'", "Make it first.")


def _numbers(name: str, text: str | None, default: list[float] | None) -> list[float] | None:
    if text is None:
        return default
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        raise fail(name, "numbers with commas between", repr(text)) from None
    if default is not None and len(values) != len(default):
        raise fail(name, f"{len(default)} numbers", f"{len(values)}")
    return values


def _progress(step: Iteration) -> str:
    return (
        f"  step {step.index:2d}   largest error {step.residual:9.2e}   "
        f"period {step.period:.12f}   moved {step.step:.1e}"
    )


def _print_failure(plain: Orbit, eight: Orbit, clock: _Clock, as_object: bool, console) -> None:
    stage = "plain closing" if not plain.ok else "choreography"
    if as_object:
        best = {"period": eight.period, "y0": [float(x) for x in eight.y0]}
        best |= {"largest_error": eight.residual if math.isfinite(eight.residual) else None}
        failure = {"outcome": eight.outcome.name, "stage": stage, "message": eight.message}
        failure |= {"best_iterate": best, "seconds": clock.seconds()}
        print(json.dumps(failure))  # noqa: T201
    console.print(f"[red]no orbit[/red] ({stage}): {eight.message}")


def _print_reports(claims: dict[str, Report], clock: _Clock | None, console: Console) -> None:
    table = Table("")
    for name in claims:
        table.add_column(name, overflow="fold")
    for label, text in _ROWS:
        table.add_row(label, *(text(claim) for claim in claims.values()))
    console.print(table)
    if clock:
        seconds = clock.seconds()
        console.print(f"compiling {seconds['compile']:.1f} s, the rest {seconds['solve']:.1f} s")


def _multipliers(claim: Report) -> str:
    shown = [complex(*z) for z in claim.multipliers[: len(claim.multiplier_bars)]]
    lines = [f"{z.real:+.7f}{z.imag:+.7f}i" if z.imag else f"{z.real:+.7f}" for z in shown]
    return "\n".join([*lines, f"and {claim.unit_multipliers} times 1"])


def _optional(x: float | None, form: str) -> str:
    return "-" if x is None else format(x, form)


_ROWS = (
    ("is a choreography", lambda c: f"{'yes' if c.choreography else 'NO'}"),
    ("  misses one by", lambda c: _optional(c.permutation_error, ".1e")),
    ("linear stability", lambda c: c.verdict),
    ("T |E|^(3/2)", lambda c: _optional(c.scale_free, ".13f")),
    ("period T", lambda c: f"{c.period:.13f}"),
    ("energy E", lambda c: f"{c.energy:.13f}"),
    ("angular momentum", lambda c: f"{c.angular_momentum:.1e}"),
    ("closing error", lambda c: f"{c.closure:.1e}"),
    ("  by a second method", lambda c: f"{c.recheck.closure:.1e} ({c.recheck.solver})"),
    ("  after several periods", lambda c: f"{c.return_error:.1e} ({c.periods_simulated})"),
    ("multipliers", _multipliers),
    ("rotation numbers", lambda c: "\n".join(_optional(nu, ".12f") for nu in c.exponents)),
    ("normal form: period", lambda c: f"{c.normal_form.period:.13f}" if c.normal_form else "-"),
    (
        "  first body at",
        lambda c: "({:.10f}, {:.10f})".format(*c.normal_form.y0[:2]) if c.normal_form else "-",
    ),
)


def _draw(plain: Orbit, eight: Orbit, plot: Path | None, animate: Path | None, console) -> None:
    if plot:
        from orbits.plots import orbit_picture

        titles = ["closed plainly", "closed as a choreography"]
        orbit_picture([plain, eight], plot, titles)
        console.print(f"drawn in {plot}")
    if animate:
        from jaxdyn.animate import animate as make_animation

        make_animation(jaxdyn.simulate(eight.scene, samples=180), animate)
        console.print(f"animated in {animate}")


if __name__ == "__main__":
    main()
