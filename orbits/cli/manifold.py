"""The command `orbits manifold`: the stable and unstable manifolds of a saved orbit."""

from pathlib import Path
from typing import Annotated

import typer

import jaxdyn
import orbits
from jaxdyn._text import choice, whole
from jaxdyn.cli.screen import screen
from jaxdyn.cli.shared import (
    JsonOption,
    PlotOption,
    SetOption,
    TitleOption,
    check_title,
    number,
    read,
)
from orbits.cli.shared import SceneOfFile, scene_of_file, setting

STOPPED = 1  # exit code: no strand reached its end
_KINDS = {"stable": ("stable",), "unstable": ("unstable",), "both": ("unstable", "stable")}


def manifold_command(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="An orbit that --save wrote.", callback=read)
    ],
    scene: SceneOfFile = None,
    settings: SetOption = None,
    kind: Annotated[str, typer.Option(help="stable, unstable or both.")] = "both",
    until: Annotated[
        str | None, typer.Option(metavar="NAME=LEVEL", help="End where an entry has this value.")
    ] = None,
    time: Annotated[float | None, number("Largest length of a strand.")] = None,
    strands: Annotated[int, typer.Option(help="Number of phases.")] = 40,
    branch: Annotated[str, typer.Option(help="+, - or both.")] = "both",
    error: Annotated[float, number("Largest error of the starts.")] = 1e-8,
    entries: Annotated[
        str | None, typer.Option(metavar="NAME,NAME", help="Two or three entries to draw.")
    ] = None,
    plot: PlotOption = None,
    title: TitleOption = None,
    as_object: JsonOption = False,
) -> None:
    """The stable and unstable manifolds of a periodic orbit."""
    check_title(title, plot)
    whole("--strands", strands)
    choice("--kind", kind, _KINDS)
    with screen("following the manifolds", as_object) as out:
        orbit = orbits.load(file, scene=scene_of_file(scene, settings))[0]
        options = {"until": _section(orbit.scene, until), "time": time, "strands": strands}
        found = [
            orbits.manifold(orbit, each, branch=branch, error=error, **options)
            for each in _KINDS[kind]
        ]
        if as_object:
            out.result({"manifolds": [_as_json(one) for one in found]})
        for one in found:
            out.print(str(one))
        if not any(one.ok.any() for one in found):
            raise typer.Exit(STOPPED)
        if plot:
            shown = None if entries is None else tuple(entries.split(","))
            with out.writing(plot, "drawn in"):
                orbits.drawing.manifold(found, plot, entries=shown, title=title)


def _section(scene: "jaxdyn.Scene", text: str | None):
    """The event that NAME=LEVEL describes."""
    if text is None:
        return None
    name, level = setting("--until", text, "x=0")
    names = [label for label, _ in scene.labels()]
    return jaxdyn.integrate.events.Reaches(names.index(choice("--until", name, names)), level)


def _as_json(one: "orbits.manifolds.Manifold") -> dict:
    ends = [y if ok else None for y, ok in zip(one.ends.tolist(), one.ok.tolist(), strict=True)]
    return {
        "kind": one.kind,
        "step_off": one.step_off,
        "linear_error": one.linear_error,
        "phases": one.phases.tolist(),
        "branches": one.branches.tolist(),
        "starts": one.starts.tolist(),
        "ends": ends,
        "durations": one.durations.tolist(),
        "status": one.status.tolist(),
    }
