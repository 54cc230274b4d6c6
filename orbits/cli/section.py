"""The command `orbits section`: where the motions of many starts cross a surface of section."""

import itertools
import math
from pathlib import Path
from typing import Annotated

import typer

import jaxdyn
import orbits
from jaxdyn._text import choice, fail, number_of, whole
from jaxdyn.cli.docstrings import scene_settings
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import (
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    TitleOption,
    check_title,
    number,
    output_option,
)
from jaxdyn.files.output_files import table_path
from orbits.cli.shared import grid, numbers, setting

STOPPED = 1  # exit code: a start has fewer crossings than wanted
_DIRECTIONS = {"up": 1, "down": -1, "both": 0}
_MOST_CROSSINGS = 1_000_000
_MOST_STARTS = 100_000
_RTOL = 1e-10  # the default of orbits.section, which --help does not load


def section_command(
    name: SceneArgument,
    event: Annotated[
        str,
        typer.Option(metavar="NAME=LEVEL", help="The section, or every=PERIOD for equal times."),
    ],
    settings: SetOption = None,
    direction: Annotated[str, typer.Option(help="Crossings that count: up, down or both.")] = "up",
    starts: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=A:B:N", help="N values of an entry, or one; repeatable."),
    ] = None,
    energy: Annotated[
        str | None,
        typer.Option(metavar="E,...", help="Energies of the starts; each is a panel."),
    ] = None,
    unknown: Annotated[
        str | None, typer.Option(metavar="NAME", help="Entry that the energy determines.")
    ] = None,
    sign: Annotated[
        int | None, typer.Option(help="1 for the larger of two solutions, or -1.")
    ] = None,
    crossings: Annotated[int, typer.Option(help="Crossings of each start.")] = 200,
    t1: Annotated[float | None, number("Latest time of a crossing.")] = None,
    coordinates: Annotated[
        str | None, typer.Option(metavar="NAME,NAME", help="The two entries to draw.")
    ] = None,
    rtol: Annotated[float, number("Relative tolerance of a step.")] = _RTOL,
    plot: PlotOption = None,
    title: TitleOption = None,
    csv: Annotated[Path | None, output_option(table_path, "Write all crossings (.csv).")] = None,
    as_object: JsonOption = False,
) -> None:
    """Draw a surface of section from many starts, whose energy completes them."""
    check_title(title, plot)
    whole("--crossings", crossings, most=_MOST_CROSSINGS)
    levels = _levels(energy, unknown, sign)
    place = setting("--event", event, "x=0 or every=2*pi")
    chosen, given = scene_settings(name, settings), grid("--starts", starts)
    options = {"t1": t1, "coordinates": coordinates and coordinates.split(","), "rtol": rtol}
    choice("--direction", direction, _DIRECTIONS)
    with screen(f"crossing the section of {name}", as_object) as out:
        scene = jaxdyn.scenes.catalogue.build_smooth(name, chosen, t1)
        plane = _event(scene, place, direction)
        each = [_starts(scene, plane, given, level, unknown, sign) for level in levels]
        tables = [orbits.section(scene, plane, y, crossings=crossings, **options) for y in each]
        if as_object:
            record = [orbits.sections.records.as_json(table) for table in tables]
            out.result({"scene": name, "sections": record})
        else:
            for table in tables:
                _print(table, out)
        if csv:
            with out.writing(csv, "written to"):
                orbits.sections.records.write_csv(csv, tables)
        if plot:
            with out.writing(plot, "drawn in"):
                orbits.drawing.section(tables, plot, title=title)
        if not all(map(_done, tables)):
            raise typer.Exit(STOPPED)


def _levels(energy: str | None, unknown: str | None, sign: int | None) -> list:
    """The energies; [None] if they are those of the starts."""
    if energy is not None:
        return numbers("--energy", energy)
    for option, given in (("--unknown", unknown), ("--sign", sign)):
        if given is not None:
            raise fail(option, "--energy with it", "none", "The energy determines that entry.")
    return [None]


def _event(
    scene: "jaxdyn.Scene", place: tuple[str, float], direction: str
) -> "jaxdyn.integrate.events.Event":
    name, level = place
    if name == "every":
        return jaxdyn.integrate.events.Every(level)
    labels = [label for label, _ in scene.labels()]
    entry = labels.index(choice("--event", name, [*labels, "every"]))
    return jaxdyn.integrate.events.Reaches(entry, level, _DIRECTIONS[direction])


def _starts(scene, plane, given: dict[str, list[float]], energy, unknown, sign):
    """The starts with all combinations of the given values; other entries are the scene's own."""
    whole("--starts", math.prod(map(len, given.values())), most=_MOST_STARTS)
    labels = [label for label, _ in scene.labels()]
    for label in given:
        choice("--starts", label, labels)
    own = dict(zip(labels, [[float(y)] for y in scene.y0], strict=True))
    if energy is None:
        return list(map(list, itertools.product(*(own | given).values())))
    fixed = orbits.sections.coordinates.fixed_entry(plane)
    free = labels[orbits.sections.coordinates.unknown_of(scene, plane, unknown)]
    if fixed is not None:
        own[labels[fixed]] = [float(plane.level)]
    own.pop(free)
    entries = own | given
    columns = zip(*itertools.product(*entries.values()), strict=True)
    rows = dict(zip(entries, map(list, columns), strict=True))
    return orbits.sections.complete(scene, plane, rows, energy=energy, unknown=unknown, sign=sign)


def _done(table: "orbits.sections.SectionPoints") -> bool:
    """Whether all starts in the allowed region have all their crossings."""
    codes = (jaxdyn.Status.OK, jaxdyn.Status.FORBIDDEN)
    return bool(table.ok.any()) and all(code in codes for code in table.status)


def _print(table: "orbits.sections.SectionPoints", out: Screen) -> None:
    starts = number_of(int((table.counts > 0).sum()), "start")
    out.print(f"{number_of(int(table.counts.sum()), 'crossing')} of {starts}")
    drift = [x for x in table.drift.tolist() if x == x]
    if drift:
        out.print(f"  largest relative change of energy: {max(drift):.1e}")
    if not table.ok.all():
        out.print(table.message)
