"""The command `orbits family`: how an orbit changes with a parameter of its scene."""

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

import jaxdyn
import orbits
from jaxdyn._text import brief, fail, second
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
    read,
)
from orbits.cli.bifurcations.shared import check_walk, open_file
from orbits.cli.printed import print_family
from orbits.cli.shared import QuantityOption, SaveOption, bounds, not_found, printer

_REMEDY = (
    "Give another --period, or find it with `orbits find`, which has more options, and pass its "
    "file to --from-orbit."
)


_DownOption = Annotated[
    bool | None,
    typer.Option(
        "--down/--up",
        help="Towards smaller or larger values first; by default larger ones, but from a small "
        "orbit about an equilibrium away from it.",
    ),
]


def family_command(
    name: SceneArgument,
    settings: SetOption = None,
    parameter: Annotated[
        str | None, typer.Option(help="The number that varies, as g or m.0; else the energy.")
    ] = None,
    from_orbit: Annotated[
        Path | None, typer.Option(help="Start with the orbit in this file.", callback=read)
    ] = None,
    period: Annotated[float | None, number("Guess for the first orbit.")] = None,
    members: Annotated[int, typer.Option(help="Largest number of orbits.")] = 50,
    step: Annotated[float, number("Length of the first step.")] = 0.05,
    down: _DownOption = None,
    within: Annotated[
        str | None, typer.Option(metavar="A,B", help="Bounds on the parameter, or on the period.")
    ] = None,
    energies: Annotated[
        str | None, typer.Option(metavar="A,B", help="Bounds on the energy.")
    ] = None,
    plot: PlotOption = None,
    quantity: QuantityOption = None,
    title: TitleOption = None,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
) -> None:
    """The family of a scene's orbit: periods, stability and special points.

    With --save, nothing is lost if the run is interrupted: the same command resumes it from
    FILE.part.
    """
    check_title(title, plot)
    check_walk(members, step)
    limits, levels = bounds("--within", within), bounds("--energies", energies)
    chosen = scene_settings(name, settings)
    if parameter is not None:
        parameter = parameter_name("--parameter", parameter, name)
    part = save_to and save_to.with_name(f"{save_to.name}.part")
    with screen(f"looking for an orbit of {name}", as_object) as out:
        values = jaxdyn.scenes.catalogue.numbers(name, chosen)
        make, value = _maker(name, values, parameter, limits)
        orbit = _first(name, values, period, from_orbit, out)
        _check_quantity(orbit, quantity if plot else None)
        if not orbit.ok:
            raise not_found(orbit, _REMEDY, {"scene": name}, as_object, out)
        found = orbits.continue_family(
            orbit,
            make,
            value,
            step=step,
            members=members,
            down=down,
            within=limits,
            energies=levels,
            report=_reporter(out, parameter, members),
            path=open_file(part, name, chosen, [parameter] if parameter else []),
        )
        family = orbits.files.family_files.listing(found, parameter)
        if as_object:
            out.result({"scene": name} | orbits.files.family_files.as_json(family))
        else:
            print_family(family, out)
        _save(family, save_to, part, out)
        if plot:
            with out.writing(plot, "drawn in"):
                orbits.drawing.family(family, plot, quantity=quantity, title=title)


def _maker(name: str, values: dict, parameter: str | None, limits: tuple[float, float]) -> tuple:
    """The scene as a function of its parameter, and that parameter's value; None without one.

    Raises:
      ValueError: the value is not within the limits.
    """
    if parameter is None:
        return None, None
    make, value = orbits.families.parameters.maker(name, values, parameter)
    if not limits[0] <= value <= limits[1]:
        remedy = f"Use --set {parameter}=, or other bounds."
        got = f"{limits[0]:g},{limits[1]:g}"
        raise fail("--within", f"bounds around {parameter} = {value:g}", got, remedy)
    return make, value


def _check_quantity(orbit: "orbits.Orbit | orbits.HybridOrbit", quantity: str | None) -> None:
    """Refuse a quantity that cannot be drawn before the family is followed."""
    if quantity is not None:
        scene = orbits.families.family.first_scene(orbit)
        orbits.analysis.quantities.check_quantity(quantity, scene)


def _first(
    name: str, values: dict, period: float | None, from_orbit: Path | None, out: Screen
) -> "orbits.Orbit":
    """The first orbit of the family."""
    scene = jaxdyn.scenes.catalogue.entry(name).make(**values)
    if from_orbit is not None:
        orbit = orbits.load(from_orbit, scene=scene)[0]
        if orbit.scene.labels() != scene.labels():
            got = f"one of {orbit.scene.name or 'another scene'}, whose state has other entries"
            raise fail("--from-orbit", f"an orbit of {name}", got)
        return orbit
    jaxdyn.scenes.corners.check_one_phase(scene)
    return orbits.discovery.nearby.search_near(scene, period, report=printer(out), throw=False)


def _reporter(
    out: Screen, parameter: str | None, most: int
) -> Callable[["orbits.families.family.Member"], None]:
    """A callback that prints a line for each member as it is found."""
    passed = itertools.count(1)

    def report(member: "orbits.families.family.Member") -> None:
        value = "" if parameter is None else f"{parameter} {member.parameter:.10g}   "
        scene = orbits.families.family.first_scene(member.orbit)
        period = brief(member.orbit.period, second(scene.labels()), digits=12)
        out.print(f"  {value}period {period}   {member.stability.verdict}")
        out.show_task("following the family", next(passed), most)

    return report


def _save(
    family: "orbits.files.family_files.Listing",
    save_to: Path | None,
    part: Path | None,
    out: Screen,
) -> None:
    if save_to and part:
        with out.writing(save_to, "saved to"):
            orbits.files.family_files.save(save_to, family)
        jaxdyn.files.journal.remove(part)  # the family file has all of it
