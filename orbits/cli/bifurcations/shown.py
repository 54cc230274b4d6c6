"""The contents of files that `orbits curve` and `orbits diagram` wrote, for `orbits show`."""

from pathlib import Path
from typing import Any

import jaxdyn
import orbits
from jaxdyn import _scene_files
from jaxdyn._text import choice, fail
from jaxdyn.cli.docstrings import scene_settings, scenes
from jaxdyn.cli.screen import Screen
from orbits.cli.bifurcations.curve import as_json as curves_as_json
from orbits.cli.bifurcations.diagram import as_json as diagram_as_json
from orbits.cli.bifurcations.shared import Noted

_REMEDY = "A file of scenes of your own is read by orbits.curves.load or orbits.families.load."


def is_continuation(file: Path) -> bool:
    """Whether a file is one of a continuation, with families or curves."""
    with open(file, "rb") as opened:
        return jaxdyn.continuation.checkpoint.LAYOUT.format.encode() in opened.readline(200)


def show_continuation(file: Path, plot: Path | None, title: str | None, out: Screen) -> None:
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
    own = _scene_files.is_in_file(note.scene)
    if own and not note.scene.endswith(_scene_files.TEXT):
        # A file must not name code to be executed.
        remedy = (
            "Read it in Python, by orbits.families.load with the function that makes its scenes."
        )
        raise fail("file", "one of a scene of `jaxdyn list`", f"one of {note.scene}", remedy)
    chosen = scene_settings(note.scene if own else choice("scene", note.scene, scenes()), settings)
    values = jaxdyn.scenes.catalogue.numbers(note.scene, chosen)
    whats = {walk.begin.what for walk in walks}
    if len(note.parameters) == 1:
        (parameter,) = note.parameters
        make, _ = orbits.families.parameters.maker(note.scene, values, parameter)
        _show_diagram(orbits.families.load(file, make), note, plot, title, out)
    else:
        both = jaxdyn.files.codec.decode(
            note.parameters, tuple[str, str], "file", jaxdyn.continuation.checkpoint.OTHER
        )
        make, _ = orbits.families.parameters.maker_of_two(note.scene, values, both)
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
    for family in (*found.rests, *found.orbits, *found.failures):
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
