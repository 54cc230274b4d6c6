"""The commands `orbits response` and `orbits backbone`: nonlinear vibrations of a scene."""

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

import jaxdyn
import orbits
from jaxdyn._text import brief, choice, frequency_scale, second, with_unit
from jaxdyn.cli.docstrings import scene_settings
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import (
    HertzOption,
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    TitleOption,
    check_title,
    number,
    output_option,
)
from jaxdyn.cli.vibration import NearOption, at_equilibrium
from jaxdyn.files.output_files import table_path
from orbits.cli.shared import bounds, numbers

OutputOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Entry of the state; the driven or first one.")
]
CsvOption = Annotated[Path | None, output_option(table_path, "Write a table of it (.csv).")]


def response_command(
    name: SceneArgument,
    drive: Annotated[str, typer.Option(metavar="NAME", help="Coordinate on which the force acts.")],
    within: Annotated[str, typer.Option(metavar="A,B", help="Frequencies of the force [rad/s].")],
    settings: SetOption = None,
    levels: Annotated[
        str, typer.Option(metavar="A,B,..", help="Amplitudes of the force, one for each curve.")
    ] = "1",
    start: NearOption = None,
    isolas: Annotated[
        int, typer.Option(help="Frequencies at which detached curves are searched for.")
    ] = 0,
    output: OutputOption = None,
    step: Annotated[float, number("Length of the first step.")] = 0.1,
    plot: PlotOption = None,
    csv: CsvOption = None,
    hertz: HertzOption = False,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """Forced vibrations over the frequency of the force: all branches, folds, stability.

    The force is A cos(omega t), for each amplitude A; amplitude and phase are those of --output.
    """
    check_title(title, plot)
    low, high = _angular(bounds("--within", within), hertz)
    amplitudes = numbers("--levels", levels)
    with screen(f"following the responses of {name}", as_object) as out:
        scene = _scene(name, settings, start, output)
        found = orbits.frequency_response(
            scene,
            drive,
            (low, high),
            levels=amplitudes,
            isolas=isolas,
            step=step,
            report=_reporter(out, hertz),
        )
        if as_object:
            out.result({"scene": name} | _columns(found.table(output, hertz=hertz)))
        else:
            _print_response(found, output, out, hertz)
        _write(found.table(output, hertz=hertz) if csv else None, csv, out)
        if plot:
            with out.writing(plot, "drawn in"):
                orbits.drawing.frequency_response(
                    found, plot, output=output, hertz=hertz, title=title
                )


def backbone_command(
    name: SceneArgument,
    settings: SetOption = None,
    mode: Annotated[int, typer.Option(help="Number of the linear mode; the slowest is 1.")] = 1,
    energy: Annotated[float, number("Largest energy above that of the equilibrium.")] = math.inf,
    within: Annotated[
        str | None, typer.Option(metavar="A,B", help="Bounds on the frequency [rad/s].")
    ] = None,
    start: NearOption = None,
    output: OutputOption = None,
    members: Annotated[int, typer.Option(help="Largest number of vibrations.")] = 200,
    step: Annotated[float, number("Length of the first step.")] = 0.05,
    plot: PlotOption = None,
    csv: CsvOption = None,
    hertz: HertzOption = False,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """A nonlinear normal mode: free vibrations that begin at a linear mode, with growing energy.

    The picture shows the frequency against the energy; with --output, the amplitude against the
    frequency.
    """
    check_title(title, plot)
    frequencies = _angular(bounds("--within", within), hertz)
    with screen(f"following mode {mode} of {name}", as_object) as out:
        scene = _scene(name, settings, start, output)
        found = orbits.backbone(
            scene,
            mode,
            energy=energy,
            frequencies=frequencies,
            members=members,
            step=step,
            report=_reporter(out, hertz),
        )
        table = found.table(hertz=hertz)
        if as_object:
            out.result({"scene": name, "mode": mode} | _columns(table))
        else:
            out.print(escape(str(found)))
        _write(table, csv, out)
        if plot:
            with out.writing(plot, "drawn in"):
                orbits.drawing.backbone(found, plot, output=output, hertz=hertz, title=title)


def _scene(name: str, settings, start: str | None, output: str | None) -> "jaxdyn.Scene":
    scene = at_equilibrium(
        jaxdyn.scenes.catalogue.build(name, scene_settings(name, settings)), start
    )
    if output is not None:
        choice("--output", output, [label for label, _ in scene.labels()])
    return scene


def _angular(within: tuple[float, float], hertz: bool) -> tuple[float, float]:
    """Bounds on an angular frequency, from those that were given."""
    scale, _ = frequency_scale("s", hertz=hertz)
    return within[0] / scale, within[1] / scale


def _reporter(out: Screen, hertz: bool):
    def report(member) -> None:
        scale, unit = frequency_scale(second(member.orbit.scene.labels()), hertz=hertz)
        frequency = brief(scale * 2 * math.pi / member.orbit.period, unit)
        out.show_task(f"at {frequency}, {member.stability.verdict}")

    return report


def _print_response(
    found: "orbits.responses.FrequencyResponse", output, out: Screen, hertz: bool
) -> None:
    """Print the special points of each curve, and its peak."""
    of = orbits.analysis.quantities.amplitude
    output = output or found.output
    labels = found.curves[0].members[0].orbit.scene.labels()
    scale, unit = frequency_scale(second(labels), hertz=hertz)
    names = (with_unit("frequency", unit), with_unit(f"amplitude {output}", dict(labels)[output]))
    table = Table("level", "", *map(escape, names))
    peaks = found.peaks(output)
    for level, curve, peak in zip(found.levels, found.curves, peaks, strict=True):
        rows = [("peak", peak), *((str(m.kind), m) for m in curve.special)]
        for what, member in rows:
            amplitude = brief(of(member.orbit, output))
            table.add_row(brief(level), what, brief(scale * member.parameter, digits=6), amplitude)
    out.print(table)
    for level, curve in zip(found.levels, found.curves, strict=True):
        unstable = sum(m.stability.verdict == "unstable" for m in curve.members)
        text = f"level {brief(level)}: {len(curve.members)} responses, {unstable} unstable"
        reason = jaxdyn.continuation.branch.bounds_reason
        within = tuple(scale * w for w in found.frequencies)
        bounds = reason(within, f"on the frequency [{unit}], " if unit else "")
        end = curve.end.replace(reason(found.frequencies), bounds)
        out.print(f"{text}; the end: {escape(end)}")


def _columns(table) -> dict:
    """A table as lists by name; NaN becomes null."""
    return {
        name: [None if isinstance(x, float) and math.isnan(x) else x for x in list(values.array)]
        for name, values in table.variables.items()
    }


def _write(table, csv: Path | None, out: Screen) -> None:
    if csv:
        with out.writing(csv, "written to"):
            jaxdyn.files.tables.write_labelled(csv, table)
