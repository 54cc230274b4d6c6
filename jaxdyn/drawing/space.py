"""A picture of a motion in space: the paths of its points, its rods and edges.

Conventions: one colour a path, from Okabe and Ito's palette, which colour-blind readers can
tell apart; a dot where it starts, a ring where it ends, a cross where a failed run stops, a
diamond where a new phase begins. Rods and edges are dark at the start and grey at later times.
Space is drawn to one scale in all directions; motion on a line is drawn against time.
"""

import textwrap

from matplotlib.figure import Figure

from jaxdyn.drawing.contents import Paths, in_time, paths, places, segments
from jaxdyn.drawing.figures import INK, blank, finished, mark
from jaxdyn.drawing.panels import (
    colours,
    draw_lines,
    draw_paths,
    draw_starts,
    legend,
    limits,
    panel,
    size,
)
from jaxdyn.image_files import picture_path
from jaxdyn.phases import Chain
from jaxdyn.simulate import Trajectory

_POSES = {2: 5, 3: 2}  # of the rods at later times; in space more would hide each other
_NOTE_WIDTH = 60  # characters
_LINE = 0.25  # inches a line of the heading


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
