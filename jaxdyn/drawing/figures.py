"""Common parts of all pictures: an empty figure, the palette, the look of axes, output.

It uses Matplotlib's objects, never pyplot, so that no window opens and no global state changes.
"""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import ScalarFormatter
from PIL import Image

from jaxdyn._checks import fail

#: Colours of Okabe and Ito (2008), Color Universal Design, except yellow, too faint on white.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
INK = "#404040"
GRID = "#e4e4e4"
DPI = 150
#: Most bytes of a small picture, 30 kB as text: a notebook stores one for each cell with a picture.
MOST_BYTES = 22_000
_SMALL_DPI, _SMALL_COLOURS = (72, 60, 45, 30), 64  # resolutions, tried in this order

_LEGEND = 0.5  # [in] height of a legend for which a figure has room
_EDGE = 6.0  # pixels between a title and the side of a figure
_SHADED = (0.0, 0.9)  # part of a colour map that is used: its end is too faint on white


class Picture(Figure):
    """A figure that a notebook shows as the last value of a cell, without a magic line."""

    def savefig(self, *args, **kwargs) -> None:
        """Write the picture, with its layout settled.

        Axes with a fixed ratio of their sides are placed by the first pass of the layout, their
        titles by the second: after one pass a title of two lines is cut off at its top. A title
        above axes that are not in the middle is moved, if it would be cut off at a side.
        """
        self.draw_without_rendering()
        for ax in self.axes:
            box, width = ax.title.get_window_extent(), self.bbox.width
            off = max(0.0, _EDGE - box.x0) - max(0.0, box.x1 - width + _EDGE)
            x, y = ax.title.get_position()
            ax.title.set_position((x + off / ax.bbox.width, y))
        super().savefig(*args, **kwargs)

    def _repr_png_(self) -> bytes:
        """The picture as a PNG file, for IPython, which calls this."""
        return self._png()

    def small(self) -> bytes:
        """A small PNG file of at most `MOST_BYTES`, to be shown beside text.

        Raises:
          ValueError: it has too many details for that.
        """
        for dpi in _SMALL_DPI:
            file = io.BytesIO()
            image = Image.open(io.BytesIO(self._png(dpi=dpi))).convert("RGB")
            image.quantize(_SMALL_COLOURS).save(file, "png", optimize=True)
            if file.tell() <= MOST_BYTES:
                return file.getvalue()
        raise fail("picture", f"one of at most {MOST_BYTES} bytes", file.tell())

    def _png(self, **options) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png", **options)
        return file.getvalue()


F = TypeVar("F", bound=Figure)


def blank(width: float, height: float, *, dpi: int = DPI, kind: type[F] = Picture) -> F:
    """An empty figure of this size [in] and kind that needs no display."""
    layout = ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1)
    figure = kind(figsize=(width, height), dpi=dpi, layout=layout)
    FigureCanvasAgg(figure)
    return figure


def in_space(width: float, height: float) -> Any:
    """Axes in space on an empty figure of this size [in], which is their ``figure``.

    Once everything is drawn, ``ax.set_aspect("equal")`` gives all directions one scale.
    """
    # The look of the grid of solid axes has no other setting.
    with rc_context({"grid.color": GRID, "grid.linewidth": 0.6}):
        ax = blank(width, height).add_subplot(projection="3d")
    style(ax)
    return ax


def finish(figure: Figure, path: Path | None) -> Figure:
    """The figure, which is written to the path if there is one."""
    if path is not None:
        figure.savefig(path)
    return figure


def mark(marker: str, label: str, **style) -> Line2D:
    """The entry of a legend that explains a marker."""
    return Line2D([], [], color=INK, ls="", marker=marker, ms=7, label=label, **style)


def shades(count: int) -> list:
    """`count` colours: those of the palette, or ordered shades if it has too few."""
    if count <= len(PALETTE):
        return list(PALETTE[:count])
    return [tuple(shade) for shade in colormaps["viridis"](np.linspace(*_SHADED, count))]


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """Add a legend below the panels, in as many columns as fit into the width of the figure.

    If the legend is high, the figure grows; the panels do not shrink.
    """
    for columns in range(len(handles), 0, -1):
        legend = figure.legend(
            handles=list(handles),
            loc="outside lower center",
            ncols=columns,
            frameon=False,
            handlelength=1.2,
            columnspacing=1.4,
        )
        size = legend.get_window_extent()
        if columns == 1 or size.width <= figure.bbox.width:
            more = max(0.0, size.height / figure.dpi - _LEGEND)
            figure.set_figheight(figure.get_figheight() + more)
            return
        legend.remove()


def path_entries(names: Sequence[str], colours: Sequence) -> list[Line2D]:
    """The legend entries of named paths; none if there are more of them than colours."""
    named = zip(names, colours, strict=True) if 0 < len(names) <= len(PALETTE) else ()
    return [Line2D([], [], color=colour, lw=2.5, label=name) for name, colour in named]


def legend_entries(*panels) -> list[Artist]:
    """The legend entries of the panels, each name once, with the first look that it has."""
    found: dict[str, Artist] = {}
    for ax in panels:
        for handle, name in zip(*ax.get_legend_handles_labels(), strict=True):
            found.setdefault(name, handle)
    return list(found.values())


def style(ax) -> None:
    """Give axes, flat or solid, the look of all pictures."""
    ax.set_prop_cycle(color=PALETTE)  # for what is drawn from now on
    ax.grid(True, color=GRID, lw=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(colors=INK, labelsize=9)
    if ax.name == "3d":
        ax.patch.set_visible(False)  # it would cover the labels of the next panel
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        ax.tick_params(labelsize=8)
        ax.locator_params(nbins=4)
        return
    for axis in (ax.xaxis, ax.yaxis):
        formatter = axis.get_major_formatter()
        if isinstance(formatter, ScalarFormatter):  # others, as of logarithms, have no offset
            formatter.set_useOffset(False)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(INK)
