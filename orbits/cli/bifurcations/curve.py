"""The command `orbits curve`: folds and Hopf points of equilibria in two parameters."""

import math
from typing import Annotated

import typer

import jaxdyn
import orbits
from jaxdyn._text import choice, fail, whole
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import (
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    TitleOption,
    check_title,
)
from jaxdyn.cli.words import scene_settings, scenes
from orbits.cli.bifurcations.shared import StartOption, bounds, rest_start
from orbits.cli.shared import NOT_FOUND


def curve_command(
    name: SceneArgument,
    parameters: Annotated[str, typer.Option(metavar="P,Q", help="The two numbers that change.")],
    within: Annotated[str, typer.Option(metavar="A,B", help="Bounds on the first.")],
    within2: Annotated[str, typer.Option(metavar="A,B", help="Bounds on the second.")],
    settings: SetOption = None,
    start: StartOption = None,
    step: Annotated[float, typer.Option(help="Length of the first step.")] = 0.05,
    members: Annotated[int, typer.Option(help="Largest number of points of a curve.")] = 100,
    plot: PlotOption = None,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """The curves of a scene's folds and Hopf points in two parameters.

    Equilibria are followed in the first parameter, and each fold and Hopf point on the way in both
    parameters.
    """
    check_title(title, plot)
    whole("--members", members)
    if not 0 < step < math.inf:
        raise fail("--step", "> 0", step, "It is a length in the space of states and parameters.")
    limits = bounds("--within", within), bounds("--within2", within2)
    first, second = _names(parameters)
    chosen = scene_settings(name, settings)
    for parameter in (first, second):
        choice("--parameters", parameter, scenes()[name].parameters)
    with screen(f"looking for equilibria of {name}", as_object) as out:
        values = jaxdyn.scenes.catalogue.numbers(name, chosen)
        make, (p, q) = orbits.families.parameters.maker_of_two(name, values, (first, second))
        begin, special = rest_start(name, values, start), []
        for down in (False, True):
            family = jaxdyn.continue_equilibria(
                lambda x: make(x, q), p, begin, within=limits[0], down=down, step=step
            )
            out.print(str(family))
            special += family.special
        curves = []
        for point in special:
            if point.kind == jaxdyn.continuation.Kind.BRANCH:
                continue
            for down in (False, True):
                out.doing(f"following the {point.kind} at {point.parameter:.6g}")
                options = {"within": limits, "step": step, "members": members, "down": down}
                curves.append(jaxdyn.continue_curve(make, point, (point.parameter, q), **options))
                out.print(str(curves[-1]))
        if as_object:
            out.result({"scene": name, "parameters": [first, second]} | _as_json(curves))
        if not curves:
            out.print("neither a fold nor a Hopf point within the bounds")
            raise typer.Exit(NOT_FOUND)
        if plot:
            with out.writing(plot, "drawn in"):
                jaxdyn.drawing.bifurcation_curves(curves, plot, title=title)


def _names(text: str) -> tuple[str, str]:
    names = text.split(",")
    if len(names) != 2:
        raise fail("--parameters", "two names, as in P,Q", repr(text))
    return names[0].strip(), names[1].strip()


def _as_json(curves: list) -> dict:
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
