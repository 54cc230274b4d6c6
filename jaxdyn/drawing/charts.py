"""Pictures of functions of two numbers: stability charts and maps of chaos.

Charts show where motions are stable, and the growth rates elsewhere; maps show where they are
regular, and how fast the others diverge.
"""

from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, ListedColormap, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from jaxdyn._checks import check_first
from jaxdyn.analysis.floquet import Chart
from jaxdyn.chaos.maps import ChaosMap
from jaxdyn.drawing.figures import PALETTE, blank, finish, legend_below
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path

_STABLE, _GROWING, _UNDECIDED = PALETTE[0], PALETTE[1], "#9a9a9a"
_FAINT = "#fbe9de"
_MOST = 8.0  # largest MEGNO with a colour of its own: above it a motion is chaotic beyond doubt
_REGULAR = 2.0  # the MEGNO of quasi-periodic motions


@check_first
def stability_chart(
    chart: Chart, path=None, *, names=("first", "second"), title: str | None = None
) -> Figure:
    """A picture of a chart: stable points in blue, unstable ones the darker, the faster they grow.

    Args:
      chart: result of `floquet.chart` or of `jaxdyn.hard.cases.shaken.upright_chart`, at least
        2 x 2.
      path: file to write, .png, .pdf or .svg.
      names: its two parameters, with their units; the first goes up, the second across.
      title: its title.
    Raises:
      ValueError: `path` cannot be written.
    """
    path = picture_path(path)
    figure = blank(6.8, 4.6)
    ax: Any = figure.add_subplot()
    grid = {"shading": "nearest", "rasterized": True}
    growing = np.where(chart.verdict == "unstable", chart.growth, np.nan)
    shades = LinearSegmentedColormap.from_list("growth", [_FAINT, _GROWING, "#5a2400"])
    fastest = np.nanmax(growing, initial=0.0)
    drawn = ax.pcolormesh(
        chart.second, chart.first, growing, cmap=shades, vmin=0.0, vmax=fastest or 1.0, **grid
    )
    for verdict, colour in (("stable", _STABLE), ("undecided", _UNDECIDED)):
        area = np.where(chart.verdict == verdict, 1.0, np.nan)
        ax.pcolormesh(chart.second, chart.first, area, cmap=ListedColormap([colour]), **grid)
    figure.colorbar(drawn, ax=ax, label="growth rate [1/s]")
    ax.set(xlabel=names[1], ylabel=names[0], title=readable(title))
    shown = [("stable", _STABLE), ("unstable", _GROWING), ("undecided", _UNDECIDED)]
    handles = [Patch(color=c, label=name) for name, c in shown if (chart.verdict == name).any()]
    legend_below(figure, handles)
    return finish(figure, path)


@check_first
def chaos_map(
    found: ChaosMap, path=None, *, names=("first", "second"), title: str | None = None
) -> Figure:
    """A picture of a map: regular motions in white to blue, chaotic ones in red.

    Args:
      found: result of `chaos.chaos_map`, at least 2 x 2.
      path: file to write, .png, .pdf or .svg.
      names: its two numbers, with their units; the first goes up, the second across.
      title: its title.
    Raises:
      ValueError: `path` cannot be written.
    """
    path = picture_path(path)
    figure = blank(6.8, 4.8)
    ax: Any = figure.add_subplot()
    drawn = ax.pcolormesh(
        found.second,
        found.first,
        np.clip(found.mean, 0.0, _MOST),
        cmap="RdBu_r",
        norm=TwoSlopeNorm(_REGULAR, 0.0, _MOST),
        shading="nearest",
        rasterized=True,
    )
    # This colour shows where there is no motion.
    ax.set_facecolor("#d9d9d9")
    figure.colorbar(drawn, ax=ax, label="mean MEGNO (2: regular)", extend="max")
    ax.set(xlabel=names[1], ylabel=names[0], title=readable(title))
    return finish(figure, path)
