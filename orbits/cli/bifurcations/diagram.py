"""The command `orbits diagram`: equilibria, orbits and period doublings over a parameter."""

from typing import Annotated, Any

import typer

import jaxdyn
import orbits
from jaxdyn.cli.docstrings import parameter_name, scene_settings
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import (
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    TitleOption,
    check_title,
    number,
)
from orbits.cli.bifurcations.shared import (
    KeepOption,
    StartOption,
    check_walk,
    equilibrium_start,
    open_file,
)
from orbits.cli.shared import bounds


def diagram_command(
    name: SceneArgument,
    parameter: Annotated[str, typer.Option(help="The parameter that varies.")],
    within: Annotated[str, typer.Option(metavar="A,B", help="Bounds on the parameter.")],
    settings: SetOption = None,
    start: StartOption = None,
    depth: Annotated[int, typer.Option(help="Number of successive doublings to follow.")] = 1,
    step: Annotated[float, number("Length of the first step.")] = 0.05,
    members: Annotated[int, typer.Option(help="Largest number of orbits of a family.")] = 40,
    entry: Annotated[str | None, typer.Option(help="The entry of the state to draw.")] = None,
    plot: PlotOption = None,
    title: TitleOption = None,
    save_to: KeepOption = None,
    as_object: JsonOption = False,
) -> None:
    """The bifurcation diagram of a scene: equilibria, orbits, period doublings.

    With --save, nothing is lost if the run is interrupted: the same command resumes it.
    """
    check_title(title, plot)
    check_walk(members, step)
    limits = bounds("--within", within)
    chosen = scene_settings(name, settings)
    parameter = parameter_name("--parameter", parameter, name)
    with screen(f"looking for equilibria of {name}", as_object) as out:
        values = jaxdyn.scenes.catalogue.numbers(name, chosen)
        make, value = orbits.families.parameters.maker(name, values, parameter)
        found = orbits.diagram(
            make,
            value,
            equilibrium_start(name, values, start),
            within=limits,
            depth=depth,
            step=step,
            orbit_members=members,
            report=lambda family: out.print(str(family)),
            path=open_file(save_to, name, chosen, (parameter,)),
        )
        if as_object:
            out.result({"scene": name, "parameter": parameter} | as_json(found))
        if plot:
            with out.writing(plot, "drawn in"):
                orbits.drawing.diagram(found, plot, entry=entry, parameter=parameter, title=title)


def as_json(found: "orbits.families.Diagram") -> dict[str, Any]:
    """The special points, and the branches that were not followed, as a JSON object."""
    equilibria = [
        {"kind": str(x.kind), "parameter": x.parameter, "state": x.state.tolist()}
        for family in found.equilibria
        for x in family.special
    ]
    special = [
        {
            "kind": str(x.kind),
            "parameter": x.parameter,
            "period": x.orbit.period,
            "doublings": doublings,
        }
        for family, doublings in zip(found.orbits, found.depths, strict=True)
        for x in family.special
    ]
    failures = [
        {"kind": str(x.point.kind), "parameter": x.point.parameter, "reason": x.reason}
        for x in found.failures
    ]
    return {"equilibria": equilibria, "orbits": special, "not_followed": failures}
