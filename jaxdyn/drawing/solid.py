"""Solid axes as large as their figure allows; Matplotlib leaves room for every orientation.

The extent of a box with its ticks and labels is measured, the box is scaled up to the width of its
column, and the figure gets the required height. Labels do not scale, so this is repeated; their
positions converge within a few rounds.
"""

import itertools

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import proj3d

_ROUNDS = 3
_PAD = 0.1  # [in] space around the axes
_HIGHEST = 1.2  # largest height of a panel over its width


def fill(figure: Figure) -> None:
    """Make the solid axes of a figure, all in one grid, fill it; others are unchanged."""
    solid = [ax for ax in figure.axes if ax.name == "3d"]
    if not solid:
        return
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    place = solid[0].get_subplotspec()
    assert place is not None  # panels are subplots
    rows, columns = place.get_gridspec().get_geometry()
    pad = _PAD * figure.dpi
    below = 2 * pad + sum(legend.get_window_extent().height for legend in figure.legends)
    # The title above all panels, if there is one, and those of the panels of a row.
    above = sum(text.get_window_extent().height + pad for text in figure.texts)
    named = 2 * pad + max(ax.title.get_window_extent().height for ax in solid)
    column = figure.bbox.width / columns
    for _ in range(_ROUNDS):
        taken = [_extent(ax) for ax in solid]
        squares = [ax.bbox.frozen() for ax in solid]
        wide = max(box.width for box in taken)
        high = max(box.height for box in taken)
        grow = min((column - 2 * pad) / wide, _HIGHEST * column / high)
        row = grow * high + named
        size = np.array([figure.bbox.width, below + rows * row + above])
        figure.set_size_inches(size / figure.dpi)
        for text in figure.texts:
            text.set_y(1 - pad / size[1])
        for i, (ax, box, square) in enumerate(zip(solid, taken, squares, strict=True)):
            bottom = below + (rows - 1 - i // columns) * row
            middle = np.array([(i % columns + 0.5) * column, bottom + grow * high / 2])
            side = grow * square.width
            corner = middle - grow * (_middle(box) - _middle(square)) - side / 2
            ax.set_position([*corner / size, *side / size])
            # Solid axes ignore the position of a title, but respect that of its text.
            ax.set_title(ax.get_title(), fontsize=ax.title.get_fontsize(), y=1.0)
            ax.title.set_y((bottom + grow * high + pad - corner[1]) / side)
        figure.draw_without_rendering()


def _middle(box: Bbox) -> np.ndarray:
    """(2,) the centre of a box."""
    return np.array([box.x0 + box.x1, box.y0 + box.y1]) / 2


def _extent(ax) -> Bbox:
    """The extent of the box of the axes and its labels [pixels]."""
    renderer = ax.figure.canvas.get_renderer()
    xs, ys, zs = np.array(list(itertools.product(ax.get_xlim(), ax.get_ylim(), ax.get_zlim()))).T
    x, y, _ = proj3d.proj_transform(xs, ys, zs, ax.get_proj())
    corners = ax.transData.transform(np.stack([x, y], axis=1))
    labels = [axis.get_tightbbox(renderer) for axis in (ax.xaxis, ax.yaxis, ax.zaxis)]
    box = Bbox([corners.min(axis=0), corners.max(axis=0)])
    return Bbox.union([box, *(label for label in labels if label is not None)])
