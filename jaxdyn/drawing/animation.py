"""Animations of a motion: its bodies, and dots with fading trails, at a constant pace.

A motion of a few seconds is shown in real time, a shorter or longer one slower or faster by a
round factor, which is shown in the picture.

A GIF needs no other program, an MP4 needs ffmpeg. Frames show states of the fine curve that `paths`
finds, without interpolation between them, since a straight line between two of them is not on the
path. The background (axes, grid, labels) is drawn once and copied under every frame: Matplotlib's
own method, which redraws the figure for each frame, takes several times as long.
"""

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn._progress import each
from jaxdyn.drawing.artists import Shapes
from jaxdyn.drawing.contents import Paths, in_time, paths, places
from jaxdyn.drawing.figures import blank, legend_below, path_entries
from jaxdyn.drawing.panels import colours, draw_lines, draw_marks, limits, panel, size
from jaxdyn.drawing.solid import fill
from jaxdyn.files.output_files import animation_path
from jaxdyn.integrate.phases import HybridTrajectory
from jaxdyn.integrate.trajectory import Trajectory

_DPI = 100
_CORNER = 0.02  # distance of the clock from the edges, as a share of the figure
_SHADES = 24  # number of shades of a trail
_SHORT, _LONG = 1.0, 10.0  # [s] shortest and longest motion that is shown in real time
_WATCHED = 4.0  # [s] shortest duration of the animation of a shorter motion
_SAME = 0.02  # relative difference of two paces that is not visible
_SHORTEST = 0.02  # [s] shortest frame of a GIF: viewers slow down shorter ones


@check_first
def animate(
    motion: Trajectory | HybridTrajectory,
    path,
    *,
    entries: Sequence[str] | None = None,
    seconds: float | None = None,
    fps: float = 30,
    trail: float = 0.25,
) -> Path:
    """Write an animation of a motion, from its start to where its run ended; return the path.

    Args:
      motion: result of `simulate` or `simulate_phases`.
      path: file to write, .gif or .mp4.
      entries: names of two or three entries of the state to draw, instead of what moves in space or
        of all entries of a plain rate.
      seconds: duration of the animation [s]; by default that of the motion if this is 1 to 10 s,
        otherwise a round fraction or multiple of it, which is shown in the picture.
      fps: frames per second; in a GIF rounded to whole hundredths of a second per frame.
      trail: length of the trails as a share of the whole motion, 0 to 1.
    Raises:
      ValueError: `path` cannot be written, ffmpeg is missing for .mp4, the motion has fewer than
        two samples or nothing to draw, or `seconds`, `fps` or `trail` is out of range.
    """
    path = animation_path(path)
    _check_numbers(seconds, fps, trail)
    drawn = paths(motion, entries)
    if len(drawn.ts) < 2:
        raise _checks.fail(
            "motion", "at least 2 samples", len(drawn.ts), "Simulate with more, over a longer span."
        )
    pace = _pace(abs(drawn.ts[-1] - drawn.ts[0]), seconds)
    count, writer = _timing(path, len(drawn.ts), pace.seconds, float(fps))
    box = limits(places(drawn), drawn.equal)
    stage = blank(*size(box, drawn.equal), dpi=_DPI, kind=_Stage)
    ax = panel(stage, drawn, box)
    ax.set_title(f" \n{drawn.stopped}", fontsize=9)  # the empty line has room for the clock
    legend_below(stage, path_entries(drawn.names, colours(drawn)))
    fill(stage)
    actors = _Actors(
        ax=ax, drawn=drawn, box=box, trail=trail, note=pace.note if drawn.second else ""
    )
    with writer.saving(stage, str(path), _DPI):
        stage.set_up(actors.all)
        for sample in each(in_time(drawn, count), "drawing frames"):
            actors.move(sample)
            writer.grab_frame()
    return path


class _Stage(Figure):
    """A figure whose background is drawn once; saving it draws the moving artists on top."""

    def set_up(self, actors) -> None:
        """Draw the background, once the writer is set up, since that may change the size."""
        self.actors = actors
        for actor in actors:
            actor.set_animated(True)
        self.agg = FigureCanvasAgg(self)
        self.agg.draw()
        self.ground = self.agg.copy_from_bbox(self.bbox)

    def savefig(self, fname, **kwargs) -> None:
        """Write one frame as bytes, in the format and with the dpi of this figure."""
        del kwargs
        self.agg.restore_region(self.ground)
        for actor in self.actors:
            if isinstance(actor, Line3DCollection):
                actor.do_3d_projection()
            self.draw_artist(actor)
        fname.write(self.agg.buffer_rgba())


class _Actors:
    """The moving artists: trails, shapes, dots and the time, on axes of a figure."""

    def __init__(self, ax, drawn: Paths, box: np.ndarray, trail: float, note: str):
        self.drawn, self.trail, self.note = drawn, trail * (drawn.ts[-1] - drawn.ts[0]), note
        own = colours(drawn)
        fade = np.linspace(0.0, 1.0, _SHADES + 1)[1:]
        # Colours are mixed with white: transparent ones would show beads where segments overlap.
        pale = [1 - f * (1 - np.array(to_rgb(colour))) for f in fade for colour in own]
        widths = np.repeat(0.4 + 2.2 * fade, len(own))
        self.trails = draw_lines(ax, [], colors=pale, linewidths=widths)
        draw_marks(ax, drawn)
        self.shapes = Shapes(ax, drawn, box)
        self.dots = [
            ax.plot(*point[:, None], "o", color=colour, ms=10, mec="white")[0]
            for point, colour in zip(drawn.xyz[0], own, strict=True)
        ]
        # Enough decimal places to resolve a hundredth of the span.
        self.places = max(0, 2 - math.floor(math.log10(abs(drawn.ts[-1] - drawn.ts[0]))))
        # It is in the corner of the figure, since solid axes reach beyond their own corner.
        self.clock = ax.figure.text(_CORNER, 1 - _CORNER, "", va="top")

    @property
    def all(self) -> list:
        """The artists of a frame, from back to front."""
        return [self.trails, *self.shapes.all, *self.dots, self.clock]

    def move(self, sample: int) -> None:
        """Move everything to its position at this sample."""
        xyz, ts = self.drawn.xyz, self.drawn.ts
        tail = int(np.argmax(np.abs(ts - ts[sample]) <= abs(self.trail)))
        ends = np.linspace(tail, sample, _SHADES + 1).astype(int)
        spans = list(itertools.pairwise(ends))
        trails = [path[a : b + 1] for a, b in spans for path in np.moveaxis(xyz, 1, 0)]
        self.trails.set_segments(trails)
        self.shapes.show(sample)
        for dot, point in zip(self.dots, xyz[sample], strict=True):
            (dot.set_data if len(point) == 2 else dot.set_data_3d)(*point[:, None])
        self.clock.set_text(f"t = {ts[sample]:.{self.places}f}{self.drawn.second}{self.note}")


class _Pace(NamedTuple):
    """The duration of an animation [s], and the text beside its clock."""

    seconds: float
    note: str


def _pace(span: float, seconds: float | None) -> _Pace:
    """The given pace; else real time for a span of moderate length, or a round factor of it."""
    if seconds is not None:
        return _Pace(float(seconds), _factor(span / seconds))
    if _SHORT <= span <= _LONG:
        return _Pace(span, "")
    rounds = np.array([1.0, 2.0, 5.0, 10.0])
    least = span / _LONG if span > _LONG else _WATCHED / span
    whole = 10.0 ** np.floor(np.log10(least))
    times = float(whole * rounds[np.searchsorted(rounds, least / whole)])
    faster = times if span > _LONG else 1 / times
    return _Pace(span / faster, _factor(faster))


def _factor(faster: float) -> str:
    """The pace relative to real time, as text; empty if the difference is invisible."""
    if abs(faster - 1) < _SAME:
        return ""
    return f"  ({faster:.3g} x faster)" if faster > 1 else f"  ({1 / faster:.3g} x slower)"


def _timing(path: Path, samples: int, seconds: float, fps: float):
    """The number of frames, and the writer that shows them for the given time."""
    count = max(2, min(samples, round(seconds * fps)))
    if path.suffix.lower() == ".mp4":
        if not FFMpegWriter.isAvailable():
            raise _checks.fail(
                "path",
                "a .gif where there is no ffmpeg",
                f"'{path}'",
                "Install ffmpeg or use .gif.",
            )
        writer = FFMpegWriter(fps=count / seconds)  # pyright: ignore[reportArgumentType]
    else:
        # GIF frames last whole hundredths of a second; there are enough of them to fill the time.
        frame = max(_SHORTEST, round(seconds / count, 2))
        count = max(2, min(samples, round(seconds / frame)))
        # The writer cuts off 1000/fps [ms], so 29.999 would become 29 and then 20.
        writer = PillowWriter(fps=1 / (frame + 1e-6))  # pyright: ignore[reportArgumentType]
    return count, writer


def _check_numbers(seconds, fps, trail) -> None:
    if seconds is not None:
        _checks.positive("seconds", seconds)
    _checks.positive("fps", fps, "It is in frames per second.")
    if not 0 <= trail <= 1:
        raise _checks.fail("trail", "a share between 0 and 1", trail)
