"""Pictures of a motion: its paths in space, and the entries of its state against time.

Drawn with Matplotlib's objects, never with pyplot: no window opens, no global state changes,
nothing is left behind. Every function returns the `Figure` and writes it where a path is given.

Conventions: one colour a path, from Okabe and Ito's palette, which colour-blind readers can
tell apart; a dot where it starts, a ring where it ends, a cross where a failed run stops, a
diamond where a new phase begins. Rods and edges are dark at the start and grey at later times.
Space is drawn to one scale in all directions; motion on a line is drawn against time.
What there is to draw is found by `paths`.
"""

import itertools
import textwrap
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from jaxdyn import _checks
from jaxdyn.image_files import picture_path
from jaxdyn.paths import Paths, in_time, paths, pieces_of, places, segments, why_stopped
from jaxdyn.phases import Chain
from jaxdyn.simulate import Trajectory

#: Okabe and Ito (2008), Color Universal Design; their yellow is left out, too faint on white.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
INK = "#404040"
DPI = 150
_GRID = "#e4e4e4"
_WIDTH = 6.4  # inches
_PIECES = 120  # of a path; see `draw_paths`
_LEAST_SHARE = {2: 0.25, 3: 0.5}  # of the widest direction that a narrow one is given
_MARGIN = 1.12  # of the box drawn to the box of the motion
_ENTRY = 1.15  # inches an entry of the legend
_SHADED = (0.0, 0.9)  # part of a colour map: its end is too faint on white
_POSES = {2: 5, 3: 2}  # of the rods at later times; in space more would hide each other
_NOTE_WIDTH = 60  # characters
_LINE = 0.25  # inches a line of the heading


F = TypeVar("F", bound=Figure)


def trajectory(motion: Trajectory | Chain, path=None, *, title: str | None = None) -> Figure:
    """A picture of the paths of a motion, and of the rods and edges that its system has.

    However few samples it has, its curves are smooth; see `paths`.

    Args:
      motion: what `simulate` or `phases.run` returned; with ``throw=False`` also one that
        stopped early, which is then marked by crosses and a line in the title.
      path: file to write, .png, .pdf or .svg.
      title: what stands above it.
    Returns:
      The figure: a plane, a box (3-D) or x against t (1-D).
    Raises:
      ValueError: a file that cannot be written, a batch of motions, or nothing to draw.
    Example:
      >>> from jaxdyn import scenes, simulate
      >>> figure = trajectory(simulate(scenes.cannonball()), title="A throw")
      >>> figure.axes[0].get_xlabel()
      'x [m]'
    """
    path = picture_path(path)
    drawn = paths(motion)
    box = limits(places(drawn), drawn.equal)
    heading = [line for line in (title, textwrap.fill(drawn.stopped, _NOTE_WIDTH)) if line]
    width, height = size(box, drawn.equal)
    figure = blank(width, height + _LINE * len(heading))
    ax = panel(figure, drawn, box)
    ax.set_title("\n".join(heading))
    marks = [mark("o", "start")]
    draw_paths(ax, drawn)
    if len(drawn.xyz):
        _draw_poses(ax, drawn)
        draw_starts(ax, drawn)
        _draw_corners(ax, drawn)
        _draw_ends(ax, drawn)
    if drawn.corners:
        marks += [mark("D", "next phase", markersize=5)]
    ring = mark("x", "stop") if drawn.stopped else mark("o", "end", markerfacecolor="white")
    legend(figure, drawn, *marks, ring)
    return finished(figure, path)


def time_series(motion: Trajectory | Chain, names=None, path=None) -> Figure:
    """A picture of entries of the state against time, one panel a unit.

    Args:
      motion: what `simulate` or `phases.run` returned.
      names: labels of the entries to draw, e.g. ``["x", "vx"]``; all of them if left out.
      path: file to write, .png, .pdf or .svg.
    Raises:
      ValueError: an unknown label, or a file that cannot be written.
    """
    path = picture_path(path)
    pieces = pieces_of(motion)
    scene = pieces[0].scene
    # Without units places and velocities are still drawn apart.
    units = dict(scene.system.labels())
    plain = all(unit == "1" for _, unit in scene.labels())
    names = list(units) if names is None else [_checks.choice("names", x, units) for x in names]
    if not names:
        raise _checks.fail("names", "one of " + ", ".join(units), "none")
    ts = np.concatenate([piece.ts for piece in pieces])
    values = {name: np.concatenate([piece[name] for piece in pieces]) for name in names}
    shown = list(dict.fromkeys(units[name] for name in names))
    figure = blank(_WIDTH, 0.8 + 2.1 * len(shown))
    panels = figure.subplots(len(shown), sharex=True, squeeze=False)[:, 0]
    for ax, unit in zip(panels, shown, strict=True):
        _style(ax)
        for i, name in enumerate(x for x in names if units[x] == unit):
            dash = ("-", "--", ":")[i // len(PALETTE) % 3]
            ax.plot(ts, values[name], dash, color=PALETTE[i % len(PALETTE)], lw=1.6, label=name)
        ax.margins(x=0)
        ax.set_ylabel("" if plain else f"[{unit}]")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    panels[-1].set_xlabel("t" if plain else "t [s]")
    panels[0].set_title(textwrap.fill(why_stopped(motion), _NOTE_WIDTH))
    return finished(figure, path)


def limits(xyz: np.ndarray, equal: bool) -> np.ndarray:
    """Lower and upper ends (D, 2) of a box with some air around points (..., D)."""
    flat = xyz.reshape(-1, xyz.shape[-1])
    if not len(flat):
        return np.tile([-1.0, 1.0], (flat.shape[1], 1))
    low, high = flat.min(axis=0), flat.max(axis=0)
    middle, half = (low + high) / 2, (high - low) / 2
    if equal:
        half = np.maximum(half, _LEAST_SHARE[flat.shape[1]] * half.max())
    # A body at rest has no extent; below a millionth of its place axes have no digits left.
    half = np.where(half > 1e-6 * np.abs(middle), half, np.maximum(np.abs(middle), 1.0) / 2)
    return middle[:, None] + _MARGIN * half[:, None] * np.array([-1.0, 1.0])


def size(box: np.ndarray, equal: bool) -> tuple[float, float]:
    """Width and height [in] of a figure that one panel of this box fills."""
    if len(box) == 3:
        return _WIDTH, 0.85 * _WIDTH
    if not equal:
        return _WIDTH, 0.6 * _WIDTH
    across, up = np.diff(box)[:, 0]
    room = _WIDTH - 1.0  # without the labels of the axis
    if up > across:
        return max(1.0 + room * across / up, 3.4), room + 1.0
    return _WIDTH, 1.4 + room * up / across


def blank(width: float, height: float, *, dpi: int = DPI, kind: type[F] = Figure) -> F:
    """An empty figure of this size [in] and kind that needs no display."""
    layout = ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1)
    figure = kind(figsize=(width, height), dpi=dpi, layout=layout)
    FigureCanvasAgg(figure)
    return figure


def panel(figure: Figure, drawn: Paths, box: np.ndarray, position=(1, 1, 1)):
    """New axes with fixed limits (D, 2) at a position (rows, columns, index) of the figure."""
    solid = len(box) == 3
    # Solid axes take the look of their grid from nowhere else.
    with rc_context({"grid.color": _GRID, "grid.linewidth": 0.6}):
        ax: Any = figure.add_subplot(*position, projection="3d" if solid else None)
    for axis, ends, label in zip("xyz", box, drawn.labels, strict=False):
        ax.set(**{f"{axis}lim": ends, f"{axis}label": label})
    _style(ax)
    if solid:
        ax.set_aspect("equal")
        ax.set_box_aspect(np.diff(box)[:, 0], zoom=1.0)
    else:
        ax.set_aspect("equal" if drawn.equal else "auto")
    return ax


def draw_paths(ax, drawn: Paths) -> None:
    """Draw the paths of the traced points, early parts above late ones.

    Bodies that follow each other on one curve would hide each other if they were drawn one
    after the other: only the last colour would be seen. Ordered by time, every part of the
    curve has the colour of the body that was there first.
    """
    xyz = drawn.xyz
    ends = np.unique(np.linspace(0, max(len(xyz) - 1, 0), _PIECES + 1).astype(int))
    spans = list(itertools.pairwise(ends))[::-1]
    pieces = [xyz[a : b + 1, i] for a, b in spans for i in drawn.traced]
    shades = colours(drawn) * len(spans)
    draw_lines(ax, pieces, colors=shades, linewidths=1.8, capstyle="round", joinstyle="round")


def draw_starts(ax, drawn: Paths) -> None:
    """Draw a dot where each path starts."""
    for i, shade in zip(drawn.traced, colours(drawn), strict=True):
        point = drawn.xyz[0, i]
        ax.plot(*point[:, None], "o", color=shade, ms=8, mec="white", mew=0.8, zorder=4)


def draw_lines(ax, pieces, **style):
    """A collection of lines on flat or solid axes whose limits stay as they are."""
    kind = Line3DCollection if ax.name == "3d" else LineCollection
    return ax.add_collection(kind(pieces, **style), autolim=False)


def colours(drawn: Paths) -> list:
    """A colour for each path: the palette's, or shades in order where there are too few."""
    n = len(drawn.traced)
    if n <= len(PALETTE):
        return list(PALETTE[:n])
    return [tuple(shade) for shade in colormaps["viridis"](np.linspace(*_SHADED, n))]


def mark(marker: str, label: str, **style) -> Line2D:
    """An entry of the legend that explains a marker."""
    return Line2D([], [], color=INK, ls="", marker=marker, ms=7, label=label, **style)


def legend(figure: Figure, drawn: Paths, *marks: Line2D) -> None:
    """Name the marks below the figure, and the bodies where each is one free point."""
    named = not drawn.links and 1 < len(drawn.traced) <= len(PALETTE)
    shades = enumerate(colours(drawn) if named else ())
    handles = [Line2D([], [], color=c, lw=2.5, label=f"body {i + 1}") for i, c in shades]
    figure.legend(
        handles=[*handles, *marks],
        loc="outside lower center",
        ncols=max(1, int(figure.get_figwidth() / _ENTRY)),
        frameon=False,
        handlelength=1.2,
        columnspacing=1.4,
    )


def finished(figure: Figure, path: Path | None) -> Figure:
    """The figure, written if a path is given."""
    if path is not None:
        figure.savefig(path)
    return figure


def _draw_poses(ax, drawn: Paths) -> None:
    """Draw rods, edges and outlines at the start, and paler at later times."""
    if not drawn.links and not drawn.outlines:
        return
    later = in_time(drawn, _POSES[drawn.xyz.shape[-1]] + 1)[1:]
    for k, sample in enumerate(later):
        grey = str(0.75 - 0.25 * k / len(later))
        draw_lines(ax, segments(drawn, sample), colors=grey, linewidths=1.2, zorder=1)
    draw_lines(ax, segments(drawn, 0), colors=INK, linewidths=2.0, zorder=2.5)


def _draw_corners(ax, drawn: Paths) -> None:
    for corner in drawn.corners:
        for i, shade in zip(drawn.traced, colours(drawn), strict=True):
            point = drawn.xyz[corner, i]
            ax.plot(*point[:, None], "D", color=shade, ms=5, mec="white", mew=0.6, zorder=3.5)


def _draw_ends(ax, drawn: Paths) -> None:
    look = {"marker": "o", "ms": 12, "mfc": "white", "mew": 1.4, "zorder": 3}
    if drawn.stopped:
        look = {"marker": "x", "ms": 10, "mew": 2.2, "zorder": 5}
    for i, shade in zip(drawn.traced, colours(drawn), strict=True):
        ax.plot(*drawn.xyz[-1, i][:, None], color=shade, **look)


def _style(ax) -> None:
    ax.grid(True, color=_GRID, lw=0.6)
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
