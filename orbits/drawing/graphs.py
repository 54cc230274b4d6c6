"""A picture of a graph of families: each is a line, joined to others where they meet."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jaxdyn._checks import check_first
from jaxdyn.drawing.bifurcations import EQUILIBRIUM_MARKERS, STRETCHES, draw_stretches
from jaxdyn.drawing.figures import INK, blank, finish, legend_below, legend_entries, shades, style
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path
from orbits.drawing.families import MARKS, orbit_stretches
from orbits.families.graph import Graph, Place

_KINDS = {str(kind): marker for kind, marker in (*MARKS.items(), *EQUILIBRIUM_MARKERS.items())}
_THIN, _WIDER = 1.4, 2.0  # line widths


@check_first
def graph(
    found: Graph, path=None, *, parameter: str = "parameter", title: str | None = None
) -> Figure:
    """A picture of families over their parameter or energy, and of the places where they meet.

    Each family is a line of its own colour and number, which shows the periods of its orbits: solid
    where they are stable, dashed where unstable, otherwise dotted. A dotted vertical line joins a
    period doubling to the family whose orbits trace its orbit twice.

    Args:
      found: result of `orbits.graph`.
      path: file to write, .png, .pdf or .svg.
      parameter: name of the parameter, where the families have one.
      title: its title.
    Raises:
      ValueError: `path` cannot be written.
    """
    path = picture_path(path)
    over_energy = found.families[0].equations.make is None
    along = "energy" if over_energy else parameter

    def across(point: Any) -> float:
        return point.energy if over_energy else point.parameter

    figure = blank(6.8, 5.0)
    ax: Any = figure.add_subplot()
    colours = shades(len(found.families))
    for i, (family, colour) in enumerate(zip(found.families, colours, strict=True)):
        parts = orbit_stretches(family.members, family.special)
        # Each line is thinner than the last, so that all families of equal periods are visible.
        width = _THIN + _WIDER * (1 - i / len(colours))
        draw_stretches(
            ax, parts, lambda x: (across(x), x.orbit.period), "_", color=colour, lw=width
        )
        middle = family.members[int(len(family.members) * (i + 1) / (len(colours) + 1))]
        ax.annotate(
            str(i + 1),
            (across(middle), middle.orbit.period),
            textcoords="offset points",
            xytext=(0, 6),
            ha="center",
            color=colour,
            fontsize=9,
            fontweight="bold",
        )
    for place in found.places:
        _mark(ax, place, across(place))
        for i, times in zip(place.families, place.times, strict=True):
            there = np.array([across(place), times * place.period])
            ends = [found.families[i].members[n] for n in (0, -1)]
            lines = [np.array([there, (across(x), x.orbit.period)]) for x in ends]
            shortest = min(lines, key=lambda line: np.linalg.norm(line[1] - line[0]))
            if not any(x.kind == place.kind for x in found.families[i].special):
                ax.plot(*shortest.T, color=colours[i], lw=1.8, ls=":", label="_")
    ax.set(xlabel=along, ylabel="period", title=readable(title))
    style(ax)
    kinds = legend_entries(ax)
    verdicts = [
        Line2D([], [], color=INK, ls=STRETCHES[name], label=name) for name in ("stable", "unstable")
    ]
    legend_below(figure, [*verdicts, *kinds])
    return finish(figure, path)


def _mark(ax: Any, place: Place, x: float) -> None:
    """Draw a place, and a dotted line to the families that trace its orbit twice."""
    if 2 in place.times:
        periods = (place.period, 2 * place.period)
        ax.plot([x, x], periods, ls=":", lw=1.0, color=INK, zorder=2, label="_")
    ax.plot(
        [x],
        [place.period],
        _KINDS[place.kind],
        ms=7,
        color="white",
        mec=INK,
        mew=1.4,
        ls="",
        zorder=4,
        label=place.kind,
    )
