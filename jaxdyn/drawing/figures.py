"""What all pictures share: an empty figure, the palette, the look of axes, a written file.

Drawn with Matplotlib's objects, never with pyplot: no window opens, no global state changes,
nothing is left behind.
"""

from pathlib import Path
from typing import TypeVar

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

#: Okabe and Ito (2008), Color Universal Design; their yellow is left out, too faint on white.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
INK = "#404040"
GRID = "#e4e4e4"
DPI = 150


F = TypeVar("F", bound=Figure)


def blank(width: float, height: float, *, dpi: int = DPI, kind: type[F] = Figure) -> F:
    """An empty figure of this size [in] and kind that needs no display."""
    layout = ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1)
    figure = kind(figsize=(width, height), dpi=dpi, layout=layout)
    FigureCanvasAgg(figure)
    return figure


def finished(figure: Figure, path: Path | None) -> Figure:
    """The figure, written if a path is given."""
    if path is not None:
        figure.savefig(path)
    return figure


def mark(marker: str, label: str, **style) -> Line2D:
    """An entry of the legend that explains a marker."""
    return Line2D([], [], color=INK, ls="", marker=marker, ms=7, label=label, **style)


def style(ax) -> None:
    """Give axes, flat or solid, the look of all pictures."""
    ax.grid(True, color=GRID, lw=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(colors=INK, labelsize=9)
    if ax.name == "3d":
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        ax.tick_params(labelsize=8)
        ax.locator_params(nbins=4)
        return
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(INK)
