"""A picture of a family of orbits: its periods, their stability and special points."""

import itertools
import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn._checks import fail
from jaxdyn._records.kinds import check_first
from jaxdyn.drawing.figures import INK, PALETTE, blank, finished, legend_below, named, style
from jaxdyn.drawing.titles import heading
from jaxdyn.files.image_files import picture_path
from orbits.families.family import Family, Kind, first_scene
from orbits.files.family_files import Listing, listing

_WIDTH = 6.8  # inches
_STRETCHES = {"stable": "-", "unstable": (0, (4, 2)), "undecided": ":"}
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
def family(listed: Listing, path=None, *, title: str | None = None) -> Figure:
    """A picture of the periods of a family, against its parameter or the energy.

    Stable stretches are solid, unstable ones dashed, those between two verdicts or without one
    dotted; special points are marked.

    Args:
      listed: from `family_files.listing` or `family_files.load`.
      path: file to write, .png, .pdf or .svg.
      title: its title; the scene with the numbers that all orbits share by default, "" for none.
    Raises:
      ValueError: `path` cannot be written, or the family has no parameter and its scene no
        energy.
    """
    path = picture_path(path)
    if listed.parameter is None and math.isnan(listed.members[0].energy):
        raise fail("listed", "a family with a parameter or an energy", "one without both")
    figure = blank(_WIDTH, 5.0)
    ax: Any = figure.add_subplot(1, 1, 1)

    def place(entry):
        across = entry.energy if listed.parameter is None else entry.parameter
        return across, entry.orbit.period

    seen: set[str] = set()
    for one, two in itertools.pairwise(listed.members):
        verdict = one.verdict if one.verdict == two.verdict else "undecided"
        label = "_" if verdict in seen else verdict
        seen.add(verdict)
        line = tuple(zip(place(one), place(two), strict=True))
        ax.plot(*line, color=PALETTE[0], lw=1.8, ls=_STRETCHES[verdict], label=label)
    passed = np.array([place(entry) for entry in listed.members])
    ax.plot(*passed.T, ".", color=PALETTE[0], ms=4, label="_")
    start = place(listed.members[0])
    ax.plot(*start, "o", color=INK, ms=6, zorder=3, label="first")
    for (kind, marker), colour in zip(MARKS.items(), itertools.cycle(PALETTE[1:]), strict=False):
        there = np.array([place(entry) for entry in listed.special if entry.kind == kind])
        if len(there):
            ax.plot(*there.T, marker, color=colour, ms=8, mew=2, zorder=4, label=kind, ls="")
    plain = all(unit == "1" for _, unit in first_scene(listed.members[0].orbit).labels())
    energy, period = ("energy", "period") if plain else ("energy [J]", "period [s]")
    ax.set(xlabel=listed.parameter or energy, ylabel=period)
    shown = heading(title, [first_scene(entry.orbit) for entry in listed.members], _WIDTH)
    ax.set_title(shown, fontsize=10)
    style(ax)
    legend_below(figure, named(ax))
    return finished(figure, path)


def overview(found: Family) -> Figure:
    """The picture of a family in a notebook: against its parameter, whatever its name, untitled."""
    named = None if np.isnan(found.parameters).any() else "parameter"
    return family(listing(found, named), title="")
