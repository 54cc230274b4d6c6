"""The command `orbits basins`: the attractor that each start of a grid approaches."""

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

import jaxdyn
import orbits
from jaxdyn._text import fail, whole, with_null
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
    output_option,
)
from jaxdyn.files.output_files import writable
from orbits.cli.shared import grid

_MOST_STARTS = 10_000_000
_MOST_VALUES = 1000


def basins_command(
    name: SceneArgument,
    starts: Annotated[
        list[str],
        typer.Option("--grid", metavar="NAME=A:B:N", help="N values of an entry; repeatable."),
    ],
    settings: SetOption = None,
    t1: Annotated[float | None, number("Time of a round; that of the scene.")] = None,
    rounds: Annotated[int, typer.Option(help="Largest number of rounds.")] = 6,
    refine: Annotated[int, typer.Option(help="How often the boundary is refined.")] = 0,
    period: Annotated[float | None, number("Period of the forcing, if it cannot be read.")] = None,
    along: Annotated[
        tuple[str, float, float] | None,
        typer.Option(metavar="NAME LOW HIGH", help="Fractions along a parameter, tipping points."),
    ] = None,
    values: Annotated[int, typer.Option(help="Number of its values, with --along.")] = 11,
    plot: PlotOption = None,
    title: TitleOption = None,
    save: Annotated[
        Path | None,
        output_option(writable, "Keep motions as they run (.jsonl); the same call resumes."),
    ] = None,
    as_object: JsonOption = False,
) -> None:
    """Basins of attraction over a grid of starts: verified attractors and the fractions of each.

    With --along, for several values of a parameter, with the values between which an attractor
    appears or disappears; --save then writes a file for each value.
    """
    check_title(title, plot)
    axes = grid("--grid", starts)
    whole("--grid", math.prod(map(len, axes.values())), most=_MOST_STARTS)
    chosen = scene_settings(name, settings)
    options = {"rounds": rounds, "refine": refine, "period": period}
    with screen(f"finding the basins of {name}", as_object) as out:
        if along is None:
            scene = jaxdyn.scenes.catalogue.build_smooth(name, chosen)
            if plot is not None and len(axes) != 2:
                remedy = "The picture is over both."
                raise fail("--plot", "--grid for two entries", len(axes), remedy)
            found = orbits.basins(scene, axes, t1, path=save, **options)
            record = _record(found)
        else:
            found = _along(name, chosen, axes, t1, along, values, save, options, out)
            record = {"parameter": along[0], "values": found.values.tolist()}
            record |= {"fractions": found.fractions.tolist(), "bars": found.bars.tolist()}
            record |= {"tipping": [point._asdict() for point in found.tipping]}
            record |= {"basins": [_record(one) for one in found.found]}
        if as_object:
            out.result({"scene": name} | record)
        else:
            out.print(escape(str(found)))
        if plot:
            with out.writing(plot, "drawn in"):
                found.plot(plot, title=title)


def _along(
    name: str,
    chosen,
    axes,
    t1,
    along: tuple[str, float, float],
    values: int,
    save,
    options,
    out: Screen,
) -> "orbits.discovery.BasinFractions":
    parameter, low, high = along
    parameter = parameter_name("--along", parameter, name)
    whole("--values", values, least=2, most=_MOST_VALUES)
    if not low < high:
        raise fail("--along", "NAME LOW HIGH, the lower value first", f"{low} {high}")
    make, _ = jaxdyn.scenes.catalogue.function_of_numbers(name, chosen, [parameter])
    steps = [low + (high - low) * i / (values - 1) for i in range(values)]

    def find(value: float) -> "orbits.discovery.Basins":
        out.show_task(f"at {parameter} = {value:.6g}")
        path = save and save.with_stem(f"{save.stem}_{steps.index(value)}")
        scene = jaxdyn.scenes.corners.check_one_phase(make(value))
        return orbits.basins(scene, axes, t1, path=path, **options)

    return orbits.basin_fractions(find, steps)


def _record(found: "orbits.discovery.Basins") -> dict:
    attractors = [
        {
            "kind": one.kind,
            "point": one.points[0].tolist(),
            "period": one.orbit and one.orbit.period,
            "exponents": with_null(one.exponents),
            "bars": with_null(one.bars),
        }
        for one in found.attractors
    ]
    shares = {"fractions": found.fractions.tolist(), "bars": found.bars.tolist()}
    return {"names": list(found.names), "attractors": attractors} | shares
