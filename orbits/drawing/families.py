"""A picture of families of orbits: a quantity of each, their stability and special points."""

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
from jaxdyn.drawing.figures import (
    INK,
    PALETTE,
    blank,
    finish,
    legend_below,
    legend_entries,
    path_entries,
    style,
)
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from orbits.analysis.quantities import Quantity, amplitude, label, unit
from orbits.analysis.quantities import quantity as named_quantity
from orbits.families.family import Family, Member, first_scene
from orbits.files.family_files import Entry, Listing, listing, parameter_name
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit

_WIDTH = 6.8  # inches
#: Relative difference up to which orbits have the same period.
_SAME_PERIOD = 1e-9
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
    listed: Family | Listing | Sequence[Family | Listing],
    path=None,
    *,
    quantity: str | Quantity | None = None,
    parameter: str | None = None,
    title: str | None = None,
    names: Sequence[str] | None = None,
) -> Figure:
    """A picture of families: a quantity of their orbits against the parameter or the energy.

    Stable stretches are solid, unstable ones dashed, and those between two verdicts or without a
    verdict dotted; special points are marked.

    Args:
      listed: a family, or a list of one, from `family_files.load`; several are drawn on the same
        axes, each in its own colour.
      path: file to write, .png, .pdf or .svg.
      quantity: "period", "energy", "jacobi", "multiplier"; "amplitude x", "max x", "min x",
        "mean x" or "phase x" of an entry x of the state; or a function from an orbit to a number.
        See `orbits.analysis.quantities`. By default the period, or where that is the same for all,
        the amplitude of an entry that changes.
      parameter: name of the parameter of a family in the picture.
      title: its title; the scene with the numbers that all orbits share by default, "" for none.
      names: names of several families, for the legend.
    Raises:
      ValueError: `path` cannot be written, a family has no parameter and its scene no energy,
        there is no such quantity, several families are over different numbers, or `names` has not
        one name for each.
    """
    path = picture_path(path)
    several = list(listed) if isinstance(listed, list | tuple) else [listed]
    drawn = [_listing(one, parameter) for one in several]
    _check_together(drawn, names)
    if quantity is None:
        quantity = _changing([entry.orbit for one in drawn for entry in one.members])
    of_orbit = named_quantity(quantity)
    figure = blank(_WIDTH, 5.0)
    ax: Any = figure.add_subplot(1, 1, 1)
    for one, colour in zip(drawn, itertools.cycle(PALETTE), strict=False):
        _draw(ax, one, of_orbit, colour, PALETTE[len(drawn) :] or PALETTE)
    scenes = [first_scene(entry.orbit) for one in drawn for entry in one.members]
    energy = with_unit("energy", scenes[0].in_units("J"))
    ax.set(xlabel=drawn[0].parameter or energy, ylabel=_label(quantity, drawn[0]))
    ax.set_title(heading(title, scenes, _WIDTH), fontsize=10)
    style(ax)
    legend_below(figure, [*path_entries(names or (), PALETTE[: len(drawn)]), *legend_entries(ax)])
    return finish(figure, path)


def _listing(one: Family | Listing, parameter: str | None) -> Listing:
    """A family as a list, with an energy or a parameter of the given name."""
    if isinstance(one, Family):
        if parameter is not None and parameter_name(one) is None:
            raise fail("parameter", "none for a family in energy", repr(parameter))
        one = listing(one, parameter or parameter_name(one))
    if one.parameter is None and math.isnan(one.members[0].energy):
        raise fail("listed", "a family with a parameter or an energy", "one without both")
    return one


def _check_together(drawn: Sequence[Listing], names: Sequence[str] | None) -> None:
    if not drawn:
        raise fail("listed", "at least one family", "none")
    over = list(dict.fromkeys(one.parameter or "energy" for one in drawn))
    if len(over) > 1:
        raise fail("listed", "families in one parameter, or in energy", " and ".join(over))
    if names is not None and len(names) != len(drawn):
        raise fail("names", f"{len(drawn)}, one for each family", len(names))


def _changing(orbits: Sequence[Orbit | HybridOrbit]) -> str:
    """The period, or where all orbits have the same one the amplitude of an entry that changes."""
    periods = [float(orbit.period) for orbit in orbits]
    smooth = [orbit for orbit in (orbits[0], orbits[-1]) if isinstance(orbit, Orbit)]
    if np.ptp(periods) > _SAME_PERIOD * max(periods) or len(smooth) < 2:
        return "period"
    names = [name for name, _ in first_scene(orbits[0]).labels()]
    ends = np.array([[amplitude(orbit, name) for name in names] for orbit in smooth])
    largest = ends.max(axis=0)
    changes = np.ptp(ends, axis=0) / np.where(largest > 0.0, largest, 1.0)
    return f"amplitude {names[int(np.argmax(changes >= 0.5 * changes.max()))]}"


def _draw(ax, listed: Listing, of_orbit: Quantity, colour, others: Sequence) -> None:
    """Draw a family in a colour, and its special points in other ones."""

    def place(entry: Entry) -> tuple[float, float]:
        across = entry.energy if listed.parameter is None else entry.parameter
        return across, float(of_orbit(entry.orbit))

    places = {id(entry): place(entry) for entry in (*listed.members, *listed.special)}

    def placed(entry: Entry) -> tuple[float, float]:
        return places[id(entry)]

    found = stretches(listed.members, listed.special, lambda entry: entry.verdict, placed)
    draw_stretches(ax, found, placed, "{}", color=colour, lw=1.8)
    passed = [places[id(entry)] for entry in listed.members]
    ax.plot(*zip(*passed, strict=True), ".", color=colour, ms=4, label="_")
    ax.plot(*passed[0], "o", color=INK, ms=6, zorder=3, label="first")
    for (kind, marker), other in zip(MARKS.items(), itertools.cycle(others), strict=False):
        there = np.array([places[id(entry)] for entry in listed.special if entry.kind == kind])
        if len(there):
            ax.plot(*there.T, marker, color=other, ms=8, mew=2, zorder=4, label=kind, ls="")


def orbit_stretches(
    members: Sequence[Member], special: Sequence[Member]
) -> list[tuple[str, list[Member], bool]]:
    """The stretches of a family of orbits; see `jaxdyn.drawing.bifurcations.stretches`."""
    return stretches(members, special, lambda x: x.stability.verdict, lambda x: x.point.place)


def _label(quantity: str | Quantity, listed: Listing) -> str:
    if not isinstance(quantity, str):
        return label(quantity)
    return with_unit(quantity, unit(quantity, first_scene(listed.members[0].orbit)))
