"""A picture of a motion in space from three sides: its projections on the coordinate planes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.drawing.contents import Paths, paths, places
from jaxdyn.drawing.figures import blank, finish, legend_below, mark, path_entries, style
from jaxdyn.drawing.panels import WIDTH, colours, draw_marks, draw_paths, draw_starts, limits
from jaxdyn.drawing.titles import heading, scenes_of
from jaxdyn.files.output_files import picture_path
from jaxdyn.integrate.phases import HybridTrajectory
from jaxdyn.integrate.trajectory import Trajectory

#: Positions of the views, as in engineering drawings: from the front, the side and above.
_VIEWS = {(0, 0): (0, 2), (0, 1): (1, 2), (1, 0): (0, 1)}
_ROOM = 1.6  # [in] space for labels, title and legend


@check_first
def projections(
    motion: Trajectory | HybridTrajectory,
    path=None,
    *,
    entries: Sequence[str] | None = None,
    title: str | None = None,
) -> Figure:
    """The paths of a motion in space, projected on the x-z, y-z and x-y planes to one scale.

    Args:
      motion: result of `simulate` or `simulate_phases`.
      path: file to write, .png, .pdf or .svg.
      entries: names of three entries of the state to draw, instead of what moves in space.
      title: title of the picture; by default the scene with its numbers, "" for none.
    Raises:
      ValueError: `motion` is not in space or is a batch, or `path` cannot be written.
    Example:
      >>> from jaxdyn import scenes, simulate
      >>> figure = projections(simulate(scenes.hanging_spring(), samples=20))
      >>> [(ax.get_xlabel(), ax.get_ylabel()) for ax in figure.axes]
      [('x [m]', 'z [m]'), ('y [m]', 'z [m]'), ('x [m]', 'y [m]')]
    """
    path = picture_path(path)
    drawn = paths(motion, entries)
    if len(drawn.labels) != 3:
        got = f"one in {', '.join(drawn.labels)}"
        raise _checks.fail("motion", "a motion in space", got, "Use drawing.trajectory.")
    box = limits(places(drawn, shapes=False), True)
    sides = np.diff(box)[:, 0]
    scale = (WIDTH - _ROOM) / (sides[0] + sides[1])
    figure = blank(WIDTH, scale * (sides[1] + sides[2]) + _ROOM)
    grid = figure.add_gridspec(2, 2, width_ratios=sides[:2], height_ratios=sides[2:0:-1])
    for place, plane in _VIEWS.items():
        ax: Any = figure.add_subplot(grid[place])
        for axis, side in zip("xy", plane, strict=True):
            ax.set(**{f"{axis}lim": box[side], f"{axis}label": drawn.labels[side]})
        ax.set_aspect("equal")
        style(ax)
        marks = tuple((name, at[list(plane)]) for name, at in drawn.marks)
        _draw(ax, drawn._replace(xyz=drawn.xyz[..., plane], marks=marks))
    figure.suptitle(heading(title, scenes_of([motion]), WIDTH, drawn.stopped), fontsize=10)
    legend_below(figure, [*path_entries(drawn.names, colours(drawn)), mark("o", "start")])
    return finish(figure, path)


def _draw(ax, drawn: Paths) -> None:
    draw_paths(ax, drawn, colours(drawn))
    draw_marks(ax, drawn)
    if len(drawn.xyz):
        draw_starts(ax, drawn, colours(drawn))
