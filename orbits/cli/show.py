"""The command `orbits show`: the contents of a file of orbits, and a picture."""

import json
from pathlib import Path
from typing import Any

from rich.markup import escape

import jaxdyn
import orbits
from jaxdyn import _scene_files, _text
from jaxdyn._text import fail
from jaxdyn.cli.docstrings import scene_settings
from jaxdyn.cli.screen import Screen, screen
from jaxdyn.cli.shared import (
    JsonOption,
    LiveOption,
    PlotOption,
    SetOption,
    TitleOption,
    check_title,
)
from orbits.cli.bifurcations.curve import as_json as curves_as_json
from orbits.cli.bifurcations.diagram import as_json as diagram_as_json
from orbits.cli.bifurcations.shared import Noted
from orbits.cli.printed import print_family, print_reports
from orbits.cli.shared import OrbitFile, QuantityOption, SceneOfFile, draw, scene_of_file


def show_command(
    file: OrbitFile,
    scene: SceneOfFile = None,
    settings: SetOption = None,
    plot: PlotOption = None,
    quantity: QuantityOption = None,
    title: TitleOption = None,
    live: LiveOption = None,
    as_object: JsonOption = False,
) -> None:
    """Print what a file of an orbit or of a family claims, without checking it, and draw it.

    Files of `orbits curve` and `orbits diagram` can be shown as well, even while they are written.
    """
    check_title(title, plot)
    with screen(f"reading {file}", as_object) as out:
        if is_continuation(file):
            if live:
                remedy = "In Python each family of it has `live(path)`."
                raise _text.fail("--live", "a file of an orbit or a family", "another", remedy)
            if settings:
                remedy = "A file of a diagram or of curves has its own."
                raise _text.fail("--set", "none for this file", ", ".join(settings), remedy)
            show_continuation(file, scene, plot, title, out)
            return
        found = orbits.files.contents.contents(file, scene_of_file(scene, settings))
        if as_object:
            out.result(json.loads(file.read_text()))
        if isinstance(found, orbits.files.family_files.Listing):
            runs = found
            _show_family(found, file, plot, quantity, title, out)
        else:
            runs = found.orbit
            _show_orbit(found, file, plot, title, out)
        if live:
            with out.writing(live, "runs in"):
                runs.live(live)


def _show_orbit(
    found: "orbits.files.contents.Claimed",
    file: Path,
    plot: Path | None,
    title: str | None,
    out: Screen,
) -> None:
    if not out.as_object:
        more = [found.refined, found.certificate]
        for text in (_heading(found.orbit, file), found.orbit.scene, *filter(None, more)):
            out.print(escape(str(text)))
        print_reports({file.name: found.report}, out, found.orbit)
        out.print(f"these are the claims of the file; `orbits verify {file}` recomputes them")
    draw([found.orbit], [""], plot, None, out, title)


def _show_family(
    found: "orbits.files.family_files.Listing",
    file: Path,
    plot: Path | None,
    quantity: str | None,
    title: str | None,
    out: Screen,
) -> None:
    if not out.as_object:
        first = found.members[0].orbit
        for text in (_heading(first, file, found), first.scene):
            out.print(escape(str(text)))
        print_family(found, out)
    if plot:
        with out.writing(plot, "drawn in"):
            orbits.drawing.family(found, plot, quantity=quantity, title=title)


def _heading(
    orbit: "orbits.Orbit", file: Path, family: "orbits.files.family_files.Listing | None" = None
) -> str:
    """The heading, with the contents of a file and how they were computed."""
    what = "Orbit" if family is None else "Family of orbits"
    methods = [f"integrated at rtol {_text.brief(orbit.rtol)}"]
    methods += ["by an implicit method"] * orbit.stiff
    methods += ["in logarithmic time"] * (orbit.s_period is not None)
    methods += [f"by collocation on {len(orbit.mesh)} intervals"] if orbit.mesh else []
    rows = [
        ("file", str(file)),
        ("along", "" if family is None else family.parameter or "its energy and period"),
        ("closing", orbit.closing.name),
        ("turned", _text.brief(orbit.angle, "rad") if orbit.closing.turns else ""),
        ("found", ", ".join(methods)),
    ]
    return _text.table(f"{what} of {_text.title_of(orbit.scene)}", rows)


# ---- The contents of files that `orbits curve` and `orbits diagram` wrote, for `orbits show`

_REMEDY = "A file of scenes of your own is read by orbits.curves.load or orbits.families.load."


def is_continuation(file: Path) -> bool:
    """Whether a file is one of a continuation, with families or curves."""
    with open(file, "rb") as opened:
        return jaxdyn.continuation.checkpoint.LAYOUT.format.encode() in opened.readline(200)


def show_continuation(
    file: Path, scene: str | None, plot: Path | None, title: str | None, out: Screen
) -> None:
    """Print the curves or the diagram of a file, and draw them if requested."""
    kinds = (*jaxdyn.continuation.checkpoint.WHATS, orbits.families.checkpoint.ORBITS)
    kinds = (*kinds, orbits.curves.checkpoint.ORBIT_CURVE)
    walks, notes = jaxdyn.continuation.checkpoint.walks_in(file, kinds)
    found = next((note for note in notes if note.keys() == {*Noted._fields}), None)
    if found is None:
        got = "one that a program wrote, which does not name its scene"
        raise fail("file", "a file of `orbits curve` or `orbits diagram`", got, _REMEDY)
    note = jaxdyn.files.codec.decode(found, Noted, "file", jaxdyn.continuation.checkpoint.OTHER)
    settings = [f"{key}={value}" for key, value in note.settings.items()]
    name = note.scene if scene is None else scene
    if scene is None and _scene_files.is_in_file(name) and not name.endswith(_scene_files.TEXT):
        # A file must not name code to be executed.
        got, remedy = f"one of {name}", "Name the function that makes it: --scene FILE.py:NAME."
        raise fail("file", "one of a scene of `jaxdyn list`", got, remedy)
    values = jaxdyn.scenes.catalogue.numbers(name, scene_settings(name, settings))
    whats = {walk.begin.what for walk in walks}
    if len(note.parameters) == 1:
        (parameter,) = note.parameters
        make, _ = orbits.families.parameters.maker(name, values, parameter)
        _show_diagram(orbits.families.load(file, make), note, plot, title, out)
    else:
        both = jaxdyn.files.codec.decode(
            note.parameters, tuple[str, str], "file", jaxdyn.continuation.checkpoint.OTHER
        )
        make, _ = orbits.families.parameters.maker_of_two(name, values, both)
        curves: list[Any] = []
        if jaxdyn.continuation.checkpoint.CURVE in whats:
            curves += jaxdyn.continuation.load(file, make)
        if orbits.curves.checkpoint.ORBIT_CURVE in whats:
            curves += orbits.curves.load(file, make)
        _show_curves(curves, note, plot, title, out)


def _show_diagram(found: "orbits.families.Diagram", note: Noted, plot, title, out: Screen) -> None:
    (parameter,) = note.parameters
    if out.as_object:
        out.result({"scene": note.scene, "parameter": parameter} | diagram_as_json(found))
    for family in (*found.equilibria, *found.orbits, *found.failures):
        out.print(str(family))
    if plot:
        with out.writing(plot, "drawn in"):
            orbits.drawing.diagram(found, plot, parameter=parameter, title=title)


def _show_curves(curves: list[Any], note: Noted, plot, title, out: Screen) -> None:
    if out.as_object:
        names = {"scene": note.scene, "parameters": note.parameters}
        out.result(names | curves_as_json(curves))
    for curve in curves:
        out.print(str(curve))
    if plot:
        with out.writing(plot, "drawn in"):
            jaxdyn.drawing.bifurcation_curves(curves, plot, title=title)
