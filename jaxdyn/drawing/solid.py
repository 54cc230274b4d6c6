"""Solid axes as large as their figure allows; Matplotlib leaves room for every way to turn a box.

What a box with its ticks and labels takes is measured, scaled up to the width of its column, and
the figure made as high as that needs. The parts that are not scaled with it (labels) settle within
a few rounds.
"""

import itertools

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import proj3d

_ROUNDS = 3
_PAD = 0.1  # inches
_HIGHEST = 1.2  # height of a panel over its width


def fill(figure: Figure) -> None:
    """Make the solid axes of a figure, all in one row, fill it; others are left as they are."""
    solid = [ax for ax in figure.axes if ax.name == "3d"]
    if not solid:
        return
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    pad = _PAD * figure.dpi
    below = 2 * pad + sum(legend.get_window_extent().height for legend in figure.legends)
    above = 2 * pad + max(ax.title.get_window_extent().height for ax in solid)
    column = figure.bbox.width / len(solid)
    for _ in range(_ROUNDS):
        taken = [_taken(ax) for ax in solid]
        wide = max(box.width for box in taken)
        high = max(box.height for box in taken)
        grow = min((column - 2 * pad) / wide, _HIGHEST * column / high)
        size = np.array([figure.bbox.width, below + grow * high + above])
        figure.set_size_inches(size / figure.dpi)
        for i, (ax, box) in enumerate(zip(solid, taken, strict=True)):
            middle = np.array([(i + 0.5) * column, below + grow * high / 2])
            _place(ax, box, middle, grow, size)
            top = below + grow * high + pad - ax.bbox.y0
            ax.set_title(ax.get_title(), fontsize=ax.title.get_fontsize(), y=top / ax.bbox.height)
        figure.draw_without_rendering()


def _place(ax, taken: Bbox, middle: np.ndarray, grow: float, size: np.ndarray) -> None:
    """Scale the axes and put the middle of what they take to a place (2,) [pixels]."""
    square = ax.bbox
    centre = np.array([square.x0 + square.x1, square.y0 + square.y1]) / 2
    off = np.array([taken.x0 + taken.x1, taken.y0 + taken.y1]) / 2 - centre
    side = grow * square.width
    corner = middle - grow * off - side / 2
    ax.set_position([*corner / size, *np.array([side, side]) / size])
    ax.apply_aspect()


def _taken(ax) -> Bbox:
    """What the box and its labels take [pixels]."""
    renderer = ax.figure.canvas.get_renderer()
    ends = np.array(list(itertools.product(ax.get_xlim(), ax.get_ylim(), ax.get_zlim()))).T
    x, y, _ = proj3d.proj_transform(*ends, ax.get_proj())
    corners = ax.transData.transform(np.stack([x, y], axis=1))
    labels = [axis.get_tightbbox(renderer) for axis in (ax.xaxis, ax.yaxis, ax.zaxis)]
    box = Bbox([corners.min(axis=0), corners.max(axis=0)])
    return Bbox.union([box, *(label for label in labels if label is not None)])
