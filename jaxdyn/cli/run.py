"""The command `jaxdyn run`: simulates a scene, reports how its energy changes, and draws it."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

import jaxdyn
from jaxdyn._text import brief, choice, fail, number_of, second, shorten, whole
from jaxdyn.cli import completion
from jaxdyn.cli.docstrings import scene_settings, solver_names
from jaxdyn.cli.messages import in_options
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import (
    AnimateOption,
    AtOption,
    EnergiesOption,
    FreeBodyOption,
    JsonOption,
    LiveOption,
    PlayOption,
    PlotOption,
    SceneArgument,
    SecondsOption,
    SeriesOption,
    SetOption,
    SpanOption,
    TitleOption,
    check_title,
    number,
    open_page,
    output_option,
)
from jaxdyn.files.output_files import archive_path, table_path

#: Options that warnings advise.
_ADVISED = ("--solver", "--rtol")
STOPPED = 1  # exit code: the motion did not reach its end
_MOST_SAMPLES = 1_000_000  # each of which is printed or written as text
_MOST_PHASES = 24  # printed; the file of --json has all of them
_RTOL = 1e-10  # the default of jaxdyn.simulate, which --help does not load


def run_command(
    name: SceneArgument,
    settings: SetOption = None,
    t1: SpanOption = None,
    samples: Annotated[int, typer.Option(help="Number of samples in each phase.")] = 400,
    rtol: Annotated[float, number("Relative tolerance of a step.")] = _RTOL,
    solver: Annotated[
        str,
        typer.Option(
            help="auto, or one of jaxdyn.solvers, such as radau9.", autocompletion=completion.solver
        ),
    ] = "auto",
    dt: Annotated[
        float | None, number("Step [s] of a solver with a fixed step, such as verlet.")
    ] = None,
    plot: PlotOption = None,
    series: SeriesOption = None,
    energies: EnergiesOption = None,
    title: TitleOption = None,
    animate: AnimateOption = None,
    seconds: SecondsOption = None,
    free_body: FreeBodyOption = None,
    at: AtOption = None,
    play: PlayOption = False,
    live: LiveOption = None,
    csv: Annotated[Path | None, output_option(table_path, "Write times and states (.csv).")] = None,
    save: Annotated[
        Path | None, output_option(archive_path, "Save it, for jaxdyn.load (.npz).")
    ] = None,
    as_object: JsonOption = False,
) -> None:
    """Simulate a scene in all its phases, report its change of energy, and draw it if requested."""
    options = "--plot, --series, --energies or --free-body"
    check_title(title, plot, series, energies, free_body, options=options)
    _check_numbers(samples, seconds, animate, at, free_body)
    chosen = scene_settings(name, settings)
    solver = choice("solver", solver.lower(), ("auto", *solver_names()))
    with screen(f"simulating {name}", as_object) as out:
        scene = jaxdyn.scenes.catalogue.build(name, chosen)
        _write_page(scene.starting(scene.y0, t1), live, out)
        entry = jaxdyn.scenes.catalogue.entry(name)
        method = _method(solver)

        def made(scene: "jaxdyn.Scene", rtol: float) -> "jaxdyn.accuracy.end_error.Motion":
            return entry.motion(scene, t1, samples=samples, rtol=rtol, solver=method, dt=dt)

        motion = made(scene, rtol)
        out.show_task(f"simulating {name} again, to count its certain digits")
        end = jaxdyn.end_error(motion, made, rtol=rtol)
        record = {"scene": name} | jaxdyn.files.tables.record(motion, end)
        if as_object:
            out.result(record)
        else:
            _print(record, end, second(scene.labels()), out)
        _draw(motion, out, plot=plot, series=series, energies=energies, title=title)
        _animate(motion, out, animate, seconds)
        _cut_free(motion, out, free_body, at, title)
        if play:
            out.print(open_page(jaxdyn.player.play(motion), name))
        _write(motion, out, csv=csv, save=save)
        _check_arrived(motion, out)


def _check_arrived(motion, out: Screen) -> None:
    """Exit with a code of its own if the motion did not reach its end."""
    if not motion.ok:
        out.print(f"[red]stopped[/red]: {escape(in_options(motion.message, _ADVISED))}")
        raise typer.Exit(STOPPED)


def _check_numbers(
    samples: int,
    seconds: float | None,
    animate: Path | None,
    at: float | None,
    free_body: Path | None,
) -> None:
    if seconds is not None and animate is None:
        raise fail("--seconds", "--animate with it", "none", "It is how long that lasts.")
    if at is not None and free_body is None:
        raise fail("--at", "--free-body with it", "none", "It is the time of that picture.")
    remedy = f"It is at most {_MOST_SAMPLES} here; a program may take more."
    whole("samples", samples, most=_MOST_SAMPLES, remedy=remedy)


def _draw(motion, out: Screen, *, plot, series, energies, title) -> None:
    """Write the requested pictures."""
    if plot:
        with out.writing(plot, "drawn in"):
            jaxdyn.drawing.trajectory(motion, plot, title=title)
    if series:
        with out.writing(series, "drawn over time in"):
            jaxdyn.drawing.time_series(motion, series, title=title)
    if energies:
        with out.writing(energies, "with its energies in"):
            scene = jaxdyn.integrate.phases.pieces_of(motion)[0].scene
            names = list(jaxdyn.analysis.energy.energies(scene, 0.0, scene.y0))
            jaxdyn.drawing.time_series(motion, energies, names=names, title=title)


def _animate(motion, out: Screen, animate: Path | None, seconds: float | None) -> None:
    """Write the animation if it is requested."""
    if animate:
        with out.writing(animate, "animated in"):
            jaxdyn.drawing.animate(motion, animate, seconds=seconds)


def _cut_free(motion, out: Screen, path: Path | None, at: float | None, title) -> None:
    """Write the free-body diagrams if they are requested."""
    if path:
        with out.writing(path, "with its bodies cut free in"):
            jaxdyn.drawing.free_body(motion, at or 0.0, path=path, title=title)


def _write_page(scene: "jaxdyn.Scene", live: Path | None, out: Screen) -> None:
    """Write the page on which the scene runs, if requested, before the simulation."""
    if live:
        with out.writing(live, "runs in"):
            scene.live(live)


def _write(motion, out: Screen, *, csv: Path | None, save: Path | None) -> None:
    """Write the requested files."""
    if csv:
        with out.writing(csv, "written to"):
            jaxdyn.files.tables.write_csv(csv, motion)
    if save:
        with out.writing(save, "saved in"):
            motion.save(save)


def _method(name: str) -> "jaxdyn.solvers.Method | None":
    """The method with a name in lower case; None, the default, for "auto"."""
    return None if name == "auto" else getattr(jaxdyn.solvers, name.upper())


def _print(record: dict, end: "jaxdyn.accuracy.EndError", time: str, out: Screen) -> None:
    """Print the end of a motion, with its error, its phases and its energy; `time` is a unit."""
    out.print(f"[bold]{record['scene']}[/bold] at t = {escape(brief(record['t'][-1], time))}:")
    for label, shown in zip(record["labels"], end.written(), strict=True):
        out.print(f"  {escape(label):24} {shown}")
    out.print(end.message)
    phases = [
        (phase["name"], f"from {phase['t0']:.9g} to {brief(phase['t1'], time, digits=9)}")
        for phase in record["phases"]
    ]
    for name, ends in shorten(phases, _MOST_PHASES):
        out.print(f"  {name:12} {escape(ends)}")
    if record["energy_message"]:
        out.print(escape(record["energy_message"]))
    out.print(f"{number_of(record['steps'], 'step')}, {record['rejected']} rejected")
    if record["warning"]:
        out.print(f"[yellow]warning[/yellow]: {escape(in_options(record['warning'], _ADVISED))}")
