"""Axes in which a motion is drawn to one scale, and the paths drawn in them.

Pictures and animations of motions, alone or in a row, are made of these parts.
"""

import itertools
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from jaxdyn.drawing.contents import Paths
from jaxdyn.drawing.figures import GRID, INK, shades, style

WIDTH = 6.4  # width of a figure [in]
_PIECES = 120  # pieces into which a path is divided; see `draw_paths`
_LEAST_SHARE = {2: 0.25, 3: 0.5}  # least width of a direction, as a share of the widest
_JUMP = 1e-6  # least jump relative to the extent of a motion: a smaller one is rounding
_MARGIN = 1.12  # ratio of the size of the box that is drawn to that of the motion


def limits(xyz: np.ndarray, equal: bool) -> np.ndarray:
    """Lower and upper ends (D, 2) of a box around points (..., D), with a margin."""
    flat = xyz.reshape(-1, xyz.shape[-1])
    if not len(flat):
        return np.tile([-1.0, 1.0], (flat.shape[1], 1))
    low, high = flat.min(axis=0), flat.max(axis=0)
    middle, half = (low + high) / 2, (high - low) / 2
    if equal:
        half = np.maximum(half, _LEAST_SHARE[flat.shape[1]] * half.max())
    # A body at rest has no extent, and axes cannot resolve a millionth of its position.
    half = np.where(half > 1e-6 * np.abs(middle), half, np.maximum(np.abs(middle), 1.0) / 2)
    return middle[:, None] + _MARGIN * half[:, None] * np.array([-1.0, 1.0])


def size(box: np.ndarray, equal: bool) -> tuple[float, float]:
    """Width and height [in] of a figure that one panel of this box fills."""
    if len(box) == 3:
        return WIDTH, 0.85 * WIDTH
    if not equal:
        return WIDTH, 0.6 * WIDTH
    across, up = np.diff(box)[:, 0]
    room = WIDTH - 1.0  # width without the labels of the axis
    if up > across:
        return max(1.0 + room * across / up, 3.4), room + 1.0
    return WIDTH, 1.4 + room * up / across


def panel(figure: Figure, drawn: Paths, box: np.ndarray, position=(1, 1, 1)):
    """New axes with fixed limits (D, 2) at a position (rows, columns, index) of the figure."""
    solid = len(box) == 3
    # The look of the grid of solid axes has no other setting.
    with rc_context({"grid.color": GRID, "grid.linewidth": 0.6}):
        ax: Any = figure.add_subplot(*position, projection="3d" if solid else None)
    for axis, ends, label in zip("xyz", box, drawn.labels, strict=False):
        ax.set(**{f"{axis}lim": ends, f"{axis}label": label})
    style(ax)
    if solid:
        ax.set_aspect("equal")
        ax.set_box_aspect(np.diff(box)[:, 0], zoom=1.0)
    else:
        ax.set_aspect("equal" if drawn.equal else "auto")
    return ax


def draw_paths(ax, drawn: Paths, own: list) -> None:
    """Draw the paths in their own colours, early parts above late ones.

    If bodies follow each other on one curve and their paths were drawn one after the other, only
    the colour of the last would be visible. Ordered by time, every part of the curve has the colour
    of the body that was there first. A jump at the end of a phase is dashed.
    """
    xyz, over = drawn.xyz, jumps(drawn)
    ends = np.linspace(0, max(len(xyz) - 1, 0), _PIECES + 1).astype(int)
    ends = np.unique([*ends, *over, *(after - 1 for after in over)])
    spans = [(a, b) for a, b in itertools.pairwise(ends) if b not in over][::-1]
    draw_jumps(ax, [(xyz[after - 1], xyz[after]) for after in over], own)
    pieces = [path[a : b + 1] for a, b in spans for path in np.moveaxis(xyz, 1, 0)]
    draw_lines(
        ax, pieces, colors=own * len(spans), linewidths=1.8, capstyle="round", joinstyle="round"
    )


def draw_marks(ax, drawn: Paths) -> None:
    """Draw a dot with a name at each fixed place."""
    for name, place in drawn.marks:
        ax.plot(*place[:, None], "o", color=INK, ms=6, zorder=3)
        ax.text(*place, f"  {name}", color=INK, fontsize=9, va="center", zorder=3)


def jumps(drawn: Paths) -> list[int]:
    """The samples of a chain at which a phase begins elsewhere than the previous one ended."""
    return [i for i in drawn.corners if apart(drawn, i - 1, i)]


def apart(drawn: Paths, one: int, other: int) -> bool:
    """Whether two samples are at different places, to rounding."""
    extent = np.ptp(drawn.xyz, axis=0).max()
    return bool(np.abs(drawn.xyz[one] - drawn.xyz[other]).max() > _JUMP * extent)


def draw_jumps(ax, over, own: list) -> None:
    """Draw a jump of all paths, from points (n, D) to points (n, D), dashed in their colours."""
    lines = [np.stack(ends) for two in over for ends in zip(*two, strict=True)]
    if lines:
        draw_lines(ax, lines, colors=own * len(over), linewidths=1.0, linestyles="dashed")


def draw_starts(ax, drawn: Paths, own: list) -> None:
    """Draw a dot where each path starts."""
    for point, shade in zip(drawn.xyz[0], own, strict=True):
        ax.plot(*point[:, None], "o", color=shade, ms=8, mec="white", mew=0.8, zorder=4)


def draw_lines(ax, pieces, **style):
    """A collection of lines on flat or solid axes whose limits stay as they are."""
    kind = Line3DCollection if ax.name == "3d" else LineCollection
    return ax.add_collection(kind(pieces, **style), autolim=False)


def colours(drawn: Paths) -> list:
    """A colour for each path."""
    return shades(drawn.xyz.shape[1])
