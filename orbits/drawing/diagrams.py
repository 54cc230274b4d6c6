"""A picture of a bifurcation diagram: equilibria and orbits over a parameter."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn._checks import check_first, choice
from jaxdyn._text import with_unit
from jaxdyn.drawing.bifurcations import (
    EQUILIBRIUM_MARKERS,
    draw_equilibria,
    draw_stretches,
    entry_of,
)
from jaxdyn.drawing.figures import PALETTE, blank, finish, legend_below, legend_entries, style
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path
from orbits.drawing.families import MARKS, orbit_stretches
from orbits.families.diagram import Diagram, extremes
from orbits.families.family import Family

_SAME = 1e-9  # values of the parameter closer than this, in its units, are equal
_MARGIN = 0.1  # part of the height beside the orbits


@check_first
def diagram(
    found: Diagram,
    path=None,
    *,
    entry: str | None = None,
    parameter: str = "parameter",
    title: str | None = None,
) -> Figure:
    """A picture of a diagram: one entry of equilibria, and its extremes along orbits.

    Stable stretches are solid, unstable ones dashed, and those between two verdicts or without a
    verdict dotted; special points are marked.

    Args:
      found: result of `orbits.diagram`.
      path: file to write, .png, .pdf or .svg.
      entry: name of the entry of the state; by default the one that changes most.
      parameter: name of the parameter.
      title: its title.
    Raises:
      ValueError: `path` cannot be written, or there is no such entry.
    """
    path = picture_path(path)
    index, label = _entry(found, entry)
    figure = blank(6.8, 5.0)
    ax: Any = figure.add_subplot()
    draw_equilibria(ax, found.equilibria, index, "equilibria, ")
    rows = {
        id(x): extremes(x, index)
        for family in found.orbits
        for x in (*family.members, *family.special)
    }
    # A family at a single parameter, as about a centre, is drawn only as far as the others reach.
    others = [family for family in found.orbits if not _is_vertical(family)]
    if others and len(others) < len(found.orbits):
        ends = [rows[id(x)] for family in others for x in family.members]
        low, high = np.min(ends), np.max(ends)
        ax.set_ylim(low - _MARGIN * (high - low), high + _MARGIN * (high - low))
    for family in found.orbits:
        _draw_orbits(ax, family, rows)
    for point in (x for family in found.equilibria for x in family.special):
        place = ([point.parameter], [point.state[index]])
        ax.plot(
            *place,
            EQUILIBRIUM_MARKERS[point.kind],
            color=PALETTE[3],
            ms=6,
            ls="",
            zorder=4,
            label=point.name,
        )
    ax.set(xlabel=parameter, ylabel=label, title=readable(title))
    style(ax)
    legend_below(figure, legend_entries(ax))
    return finish(figure, path)


def _is_vertical(family: Family) -> bool:
    """Whether all members have one parameter."""
    parameters = [x.parameter for x in family.members]
    return bool(np.ptp(parameters) <= _SAME * min(x.point.units[-2] for x in family.members))


def _draw_orbits(ax, family: Family, rows: dict) -> None:
    """Draw the extremes of an entry along a family, and its special points."""
    parts = orbit_stretches(family.members, family.special)
    for side in (0, 1):

        def extreme(x, side=side) -> tuple[float, float]:
            return x.parameter, rows[id(x)][side]

        draw_stretches(ax, parts, extreme, "orbits, {}", color=PALETTE[1], lw=1.5)
    for point in family.special:
        ax.plot(
            [point.parameter] * 2,
            rows[id(point)],
            MARKS[point.kind],
            color=PALETTE[2],
            ms=6,
            ls="",
            zorder=4,
            label=f"{point.kind} of orbits",
        )


def _entry(found: Diagram, entry: str | None) -> tuple[int, str]:
    """The index of the entry of the state that is drawn, and its name with its unit."""
    if found.equilibria:
        return entry_of(found.equilibria, entry)
    labels = found.orbits[0].members[0].orbit.scene.labels()
    names = [name for name, _ in labels]
    index = 0 if entry is None else names.index(choice("entry", entry, names))
    return index, with_unit(*labels[index])
