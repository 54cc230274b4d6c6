"""The command `orbits curve`: special equilibria and special orbits in two parameters."""

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

import jaxdyn
import orbits
from jaxdyn._text import choice, fail
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
from orbits.cli.bifurcations.shared import (
    KeepOption,
    StartOption,
    check_walk,
    equilibrium_start,
    open_file,
)
from orbits.cli.shared import NOT_FOUND, bounds


def curve_command(
    name: SceneArgument,
    parameters: Annotated[str, typer.Option(metavar="P,Q", help="The two parameters that vary.")],
    within: Annotated[str, typer.Option(metavar="A,B", help="Bounds on the first.")],
    within2: Annotated[str, typer.Option(metavar="A,B", help="Bounds on the second.")],
    settings: SetOption = None,
    start: StartOption = None,
    from_orbit: Annotated[
        Path | None,
        typer.Option(
            help="Follow the orbit in this file, or the special points of the family in it.",
            callback=read,
        ),
    ] = None,
    kind: Annotated[
        str | None, typer.Option(help="Kind of the orbits: fold, period doubling, ...")
    ] = None,
    step: Annotated[float, number("Length of the first step.")] = 0.05,
    members: Annotated[int, typer.Option(help="Largest number of points of a curve.")] = 100,
    plot: PlotOption = None,
    title: TitleOption = None,
    save_to: KeepOption = None,
    as_object: JsonOption = False,
) -> None:
    """The curves of a scene's folds, Hopf points or special orbits in two parameters.

    Equilibria are followed in the first parameter, and each of their folds and Hopf points in both;
    with --from-orbit, the special orbits of a file are followed instead. With --save, nothing is
    lost if the run is interrupted: the same command resumes it.
    """
    check_title(title, plot)
    check_walk(members, step)
    limits = bounds("--within", within), bounds("--within2", within2)
    chosen = scene_settings(name, settings)
    first, second = (parameter_name("--parameters", one, name) for one in _names(parameters))
    if kind is not None:
        if from_orbit is None:
            raise fail("--kind", "none without --from-orbit", repr(kind))
        choice("--kind", kind, _KINDS)
    with screen(f"looking for equilibria of {name}", as_object) as out:
        values = jaxdyn.scenes.catalogue.numbers(name, chosen)
        make, both = orbits.families.parameters.maker_of_two(name, values, (first, second))
        log = open_file(save_to, name, chosen, (first, second))
        options = {"within": limits, "step": step, "members": members, "path": log}
        if from_orbit is None:
            begin = equilibrium_start(name, values, start)
            curves = list(_of_equilibria(make, both, begin, options, out))
        else:
            scene = make(*both)
            starts = list(_starts(from_orbit, scene, (first, second), both, kind))
            curves = list(_of_orbits(make, starts, options, out))
        if as_object:
            out.result({"scene": name, "parameters": [first, second]} | as_json(curves))
        if not curves:
            out.print("no curve was found: no special point within the bounds can be followed")
            raise typer.Exit(NOT_FOUND)
        if plot:
            with out.writing(plot, "drawn in"):
                jaxdyn.drawing.bifurcation_curves(curves, plot, title=title)


#: The names in `orbits.Kind` of the orbits that form curves.
_KINDS = ("fold", "branch point", "period doubling", "torus point")


def _of_equilibria(make, both, begin: list[float], options: dict, out: Screen) -> Iterator[Any]:
    """The curves of the folds and Hopf points of equilibria."""
    (p, q), special = both, []
    for down in (False, True):
        family = jaxdyn.continue_equilibria(
            lambda x: make(x, q),
            p,
            begin,
            within=options["within"][0],
            down=down,
            step=options["step"],
        )
        out.print(str(family))
        special += family.special
    found: list[Any] = []
    for point in special:
        if point.kind == jaxdyn.continuation.Kind.BRANCH:
            continue
        what = f"the {point.kind} at {point.parameter:.6g}"
        if any(curve.kind == point.kind and curve.passes([*point.x, q]) for curve in found):
            out.print(f"{what} lies on a curve above")
            continue
        for down in (False, True):
            out.show_task(f"following {what}")
            start = point.parameter, q
            curve = jaxdyn.continue_curve(make, point, start, down=down, **options)
            out.print(str(curve))
            found.append(curve)
            yield curve


def _starts(
    file: Path, scene: "jaxdyn.Scene", names: tuple[str, str], both, kind: str | None
) -> Iterator[Any]:
    """(orbit, kind, parameters) of the orbit, or of the special points of the family, in a file."""
    found = orbits.files.contents.contents(file, scene)
    if not isinstance(found, orbits.files.family_files.Listing):
        if kind is None:
            raise fail("--kind", f"the kind of the orbit, one of {', '.join(_KINDS)}", None)
        yield found.orbit, kind, both
        return
    if found.parameter not in names:
        raise fail(
            "--parameters", f"{found.parameter}, that of the family, as one", ",".join(names)
        )
    chosen = [x for x in found.special if (x.kind == kind if kind else x.kind in _KINDS)]
    if not chosen:
        raise fail("--from-orbit", f"a family with a {kind or 'special point'}", "none")
    for entry in chosen:
        value = entry.parameter
        parameters = (value, both[1]) if found.parameter == names[0] else (both[0], value)
        yield entry.orbit, entry.kind, parameters


def _of_orbits(make, starts: list, options: dict, out: Screen) -> Iterator[Any]:
    """The curves of special orbits."""
    for (orbit, kind, parameters), down in itertools.product(starts, (False, True)):
        out.show_task(f"following the {kind} at {parameters[0]:.6g}")
        try:
            curve = orbits.continue_curve(make, orbit, parameters, kind=kind, down=down, **options)
        except ValueError as error:
            if len(starts) == 1:
                raise
            out.print(f"the {kind} at {parameters[0]:.6g} is not followed: {error}")
            continue
        out.print(str(curve))
        yield curve


def _names(text: str) -> tuple[str, str]:
    names = text.split(",")
    if len(names) != 2:
        raise fail("--parameters", "two names, as in P,Q", repr(text))
    return names[0].strip(), names[1].strip()


def as_json(curves: list) -> dict[str, Any]:
    """The curves and their special points as a JSON object."""
    return {
        "curves": [
            {
                "kind": str(curve.kind),
                "parameters": curve.parameters.tolist(),
                "special": [
                    {"kind": str(x.kind), "parameters": x.parameters.tolist()}
                    for x in curve.special
                ],
                "end": curve.end,
            }
            for curve in curves
        ]
    }
