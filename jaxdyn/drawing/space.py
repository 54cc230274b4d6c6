"""A picture of a motion in space: the paths of its points, its bodies, rods and springs.

Conventions: one colour per path, from Okabe and Ito's palette, which colour-blind readers can
distinguish; a dot where it starts, a ring where it ends, a cross where a failed run stops, a
diamond where a new phase begins. Bodies and rods are dark at the start and grey at later times;
springs, pins and anchors are drawn at the start. Space is drawn to one scale in all directions;
motion on a line is drawn against time.
"""

import itertools
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.drawing.artists import ABOVE_AREAS, Shapes, draw_pose
from jaxdyn.drawing.contents import Paths, in_time, paths, places
from jaxdyn.drawing.figures import (
    PALETTE,
    blank,
    finish,
    legend_below,
    mark,
    path_entries,
    shades,
)
from jaxdyn.drawing.panels import colours, draw_marks, draw_paths, draw_starts, limits, panel, size
from jaxdyn.drawing.series import time_series
from jaxdyn.drawing.solid import fill
from jaxdyn.drawing.titles import heading, scenes_of
from jaxdyn.files.output_files import picture_path
from jaxdyn.integrate.phases import HybridTrajectory
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene

_POSES = {2: 5, 3: 2}  # number of poses at later times; in space more would overlap
_MOST_LINES = 16  # lines in space beyond which only one pose is drawn
_ABOVE = 12  # space for a pin above the axes [points]
_LINE = 0.17  # height of a line of the heading [in]


@check_first
def trajectory(
    motion: Trajectory | HybridTrajectory | Sequence[Trajectory | HybridTrajectory],
    path=None,
    *,
    entries: Sequence[str] | None = None,
    title: str | None = None,
    names: Sequence[str] | None = None,
) -> Figure:
    """A picture of the paths of one or several motions, with the moving bodies.

    Of a single motion it shows snapshots of bodies and rods at equal times, as a strobe light does:
    six in the plane, up to three in space. Curves are smooth even with few samples; see `curves`.

    Args:
      motion: result of `simulate` or `simulate_phases`; with ``throw=False`` also one that stopped
        early, which is marked by crosses and a line in the title. Several are drawn on the same
        axes, each in its own colour.
      path: file to write, .png, .pdf or .svg.
      entries: names of two or three entries of the state to draw, instead of what moves in space or
        of all entries of a plain rate.
      title: title of the picture; by default the scene with its numbers, "" for none.
      names: names of several motions, for the legend.
    Returns:
      The figure: a plane, a box (3-D) or x against t (1-D). A notebook shows it.
    Raises:
      ValueError: `path` cannot be written, `motion` is a batch, has nothing to draw, or several
        do not fit on the same axes, `names` has not one name for each, or `entries` are others.
    Example:
      >>> from jaxdyn import scenes, simulate
      >>> throws = [simulate(scenes.cannonball(speed=v)) for v in (5.0, 10.0)]
      >>> figure = trajectory(throws, names=["5 m/s", "10 m/s"])
      >>> figure.axes[0].get_xlabel()
      'x [m]'
    """
    path = picture_path(path)
    motions = list(motion) if isinstance(motion, list | tuple) else [motion]
    drawn = [paths(one, entries) for one in motions]
    _check_together(drawn, names)
    box = limits(np.concatenate([places(one) for one in drawn]), drawn[0].equal)
    width, height = size(box, drawn[0].equal)
    above = heading(title, scenes_of(motions), width, *(one.stopped for one in drawn))
    figure = blank(width, height + _LINE * above.count("\n"))
    ax = panel(figure, drawn[0], box)
    ax.set_title(above, fontsize=10, pad=_ABOVE)
    several = shades(len(drawn))
    for one, shade in zip(drawn, several, strict=True):
        own = colours(one) if len(drawn) == 1 else [shade] * one.xyz.shape[1]
        _draw(ax, one, own, box, poses=len(drawn) == 1)
    if len(drawn) > 1:
        numbered = names or [f"motion {i + 1}" for i in range(len(drawn))]
        handles = path_entries(numbered, several)
    else:
        handles = path_entries(drawn[0].names, colours(drawn[0]))
    legend_below(figure, [*handles, *_marks(drawn)])
    fill(figure)
    return finish(figure, path)


def overview(motion: Trajectory | HybridTrajectory) -> Figure:
    """The picture of a motion in a notebook, without a title: its paths, as far as they go.

    For a batch it shows the first motions, as many as there are colours; where nothing moves in
    space, it shows entries of the state against time.
    """
    if isinstance(motion, Trajectory) and motion.batch_shape:
        some = [*itertools.islice(np.ndindex(motion.batch_shape), len(PALETTE))]
        names = [", ".join(map(str, index)) for index in some]
        return trajectory([motion.one(*index) for index in some], title="", names=names)
    try:
        return trajectory(motion, title="")
    except ValueError:  # more than three entries, and no points
        return time_series(motion, title="")


def pose(scene: Scene) -> Figure:
    """The picture of a scene in a notebook: its start, without a motion."""
    now, zero = jnp.zeros(1), jnp.asarray(0)
    still = Trajectory(scene, ts=now, ys=scene.y0[None], steps=zero, rejected=zero, status=zero)
    return trajectory(still, title="")


def _draw(ax, drawn: Paths, own: list, box: np.ndarray, *, poses: bool) -> None:
    """Draw one motion in these colours."""
    draw_paths(ax, drawn, own)
    draw_marks(ax, drawn)
    shapes = Shapes(ax, drawn, box)
    if not len(drawn.xyz):
        return
    shapes.show(0)
    if poses and drawn.shapes:
        _draw_poses(ax, drawn)
    draw_starts(ax, drawn, own)
    for corner in drawn.corners:
        _draw_points(ax, drawn.xyz[corner], own, "D", ms=5, mec="white", mew=0.6, zorder=3.5)
    if drawn.stopped:
        _draw_points(ax, drawn.xyz[-1], own, "x", ms=10, mew=2.2, zorder=5)
    elif len(drawn.ts) > 1:
        _draw_points(ax, drawn.xyz[-1], own, "o", ms=12, mfc="white", mew=1.4, zorder=3)


def _draw_points(ax, places: np.ndarray, own: list, marker: str, **look) -> None:
    for point, shade in zip(places, own, strict=True):
        ax.plot(*point[:, None], marker, color=shade, **look)


def _draw_poses(ax, drawn: Paths) -> None:
    """Draw bodies and rods, paler, at later times."""
    size = drawn.xyz.shape[-1]
    if size == 3 and sum(at.shape[1] for _, at in drawn.shapes) > _MOST_LINES:
        return
    poses = _POSES[size]
    # For a motion that returns to its start, the poses are at times in between instead.
    closed = all(np.allclose(at[-1], at[0]) for _, at in drawn.shapes)
    later = in_time(drawn, poses + 2)[1:-1] if closed else in_time(drawn, poses + 1)[1:]
    for k, sample in enumerate(later):
        grey = str(0.75 - 0.25 * k / len(later))
        draw_pose(ax, drawn, sample, colors=grey, linewidths=1.1, zorder=ABOVE_AREAS)


def _marks(drawn: list[Paths]) -> list:
    """The legend entries of the marks on the paths."""
    marks = [mark("o", "start")]
    if any(one.corners for one in drawn):
        marks.append(mark("D", "next phase", markersize=5))
    if any(one.stopped for one in drawn):
        marks.append(mark("x", "stop"))
    if any(not one.stopped and len(one.ts) > 1 for one in drawn):
        marks.append(mark("o", "end", markerfacecolor="white"))
    return marks


def _check_together(drawn: list[Paths], names) -> None:
    if not drawn:
        raise _checks.fail("motion", "at least one motion", "none")
    if len({one.labels for one in drawn}) > 1:
        raise _checks.fail("motion", "motions in one space", "several", "Draw them separately.")
    if names is not None and len(names) != len(drawn):
        raise _checks.fail("names", f"one for each of {len(drawn)} motions", len(names))
