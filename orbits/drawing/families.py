"""A picture of a family of orbits: a quantity of each, their stability and special points."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn._checks import check_first, fail
from jaxdyn._text import with_unit
from jaxdyn.continuation.kinds import Kind
from jaxdyn.drawing.bifurcations import draw_stretches, stretches
from jaxdyn.drawing.figures import INK, PALETTE, blank, finish, legend_below, legend_entries, style
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from orbits.analysis.quantities import Quantity, label, unit
from orbits.analysis.quantities import quantity as named_quantity
from orbits.families.family import Family, Member, first_scene
from orbits.files.family_files import Entry, Listing, listing, parameter_name

_WIDTH = 6.8  # inches
#: Marks of special orbits.
MARKS = {
    Kind.FOLD: "s",
    Kind.BRANCH: "D",
    Kind.DOUBLING: "^",
    Kind.TORUS: "*",
    Kind.KREIN: "X",
    Kind.REST: "o",
    Kind.GRAZING: "v",
}


@check_first
def family(
    listed: Family | Listing,
    path=None,
    *,
    quantity: str | Quantity = "period",
    parameter: str | None = None,
    title: str | None = None,
) -> Figure:
    """A picture of a family: a quantity of its orbits against its parameter or the energy.

    Stable stretches are solid, unstable ones dashed, and those between two verdicts or without a
    verdict dotted; special points are marked.

    Args:
      listed: a family, or a list of one, from `family_files.load`.
      path: file to write, .png, .pdf or .svg.
      quantity: "period", "energy", "jacobi", "multiplier"; "amplitude x", "max x", "min x",
        "mean x" or "phase x" of an entry x of the state; or a function from an orbit to a number.
        See `orbits.analysis.quantities`.
      parameter: name of the parameter of a family in the picture.
      title: its title; the scene with the numbers that all orbits share by default, "" for none.
    Raises:
      ValueError: `path` cannot be written, the family has no parameter and its scene no energy, or
        there is no such quantity.
    """
    path, of_orbit = picture_path(path), named_quantity(quantity)
    if isinstance(listed, Family):
        if parameter is not None and parameter_name(listed) is None:
            raise fail("parameter", "none for a family in energy", repr(parameter))
        listed = listing(listed, parameter or parameter_name(listed))
    if listed.parameter is None and math.isnan(listed.members[0].energy):
        raise fail("listed", "a family with a parameter or an energy", "one without both")
    figure = blank(_WIDTH, 5.0)
    ax: Any = figure.add_subplot(1, 1, 1)

    def place(entry: Entry) -> tuple[float, float]:
        across = entry.energy if listed.parameter is None else entry.parameter
        return across, float(of_orbit(entry.orbit))

    places = {id(entry): place(entry) for entry in (*listed.members, *listed.special)}

    def placed(entry: Entry) -> tuple[float, float]:
        return places[id(entry)]

    found = stretches(listed.members, listed.special, lambda entry: entry.verdict, placed)
    draw_stretches(ax, found, placed, "{}", color=PALETTE[0], lw=1.8)
    passed = [places[id(entry)] for entry in listed.members]
    ax.plot(*zip(*passed, strict=True), ".", color=PALETTE[0], ms=4, label="_")
    ax.plot(*passed[0], "o", color=INK, ms=6, zorder=3, label="first")
    for (kind, marker), colour in zip(MARKS.items(), itertools.cycle(PALETTE[1:]), strict=False):
        there = np.array([places[id(entry)] for entry in listed.special if entry.kind == kind])
        if len(there):
            ax.plot(*there.T, marker, color=colour, ms=8, mew=2, zorder=4, label=kind, ls="")
    energy = with_unit("energy", first_scene(listed.members[0].orbit).in_units("J"))
    ax.set(xlabel=listed.parameter or energy, ylabel=_label(quantity, listed))
    shown = heading(title, [first_scene(entry.orbit) for entry in listed.members], _WIDTH)
    ax.set_title(shown, fontsize=10)
    style(ax)
    legend_below(figure, legend_entries(ax))
    return finish(figure, path)


def orbit_stretches(
    members: Sequence[Member], special: Sequence[Member]
) -> list[tuple[str, list[Member], bool]]:
    """The stretches of a family of orbits; see `jaxdyn.drawing.bifurcations.stretches`."""
    return stretches(members, special, lambda x: x.stability.verdict, lambda x: x.point.place)


def _label(quantity: str | Quantity, listed: Listing) -> str:
    if not isinstance(quantity, str):
        return label(quantity)
    return with_unit(quantity, unit(quantity, first_scene(listed.members[0].orbit)))
