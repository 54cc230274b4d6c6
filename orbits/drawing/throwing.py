"""A picture of throws: those that hit or go farthest, and the range at all angles."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn import Scene, simulate
from jaxdyn._checks import check_first, check_kind, fail
from jaxdyn.drawing.figures import INK, PALETTE, blank, finish, legend_below, legend_entries, style
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from orbits.targets.aim import Hits, Throws
from orbits.targets.launch import angle_of, landings, launch

_WIDTH = 6.8  # inches
_SAMPLES = 300
_COURSES = np.linspace(-5.0, 5.0, 192)  # a multiple of the throws in a call of the program
_LOOK = 1e-7  # tolerance of the range at these courses


@check_first
def throws(
    scene: Scene, best: Throws, hits: Hits | None = None, path=None, *, title: str | None = None
) -> Figure:
    """A picture of the farthest throw and of those that hit, and of the range at all angles.

    Args:
      scene: the thrown point.
      best: `aim.farthest` for one speed, or `aim.slowest`.
      hits: `aim.hit` at the same speed.
      path: file to write, .png, .pdf or .svg.
      title: its title; the scene with its numbers and the speed by default, "" for none.
    Raises:
      ValueError: `path` cannot be written, or `best` has several throws.
    """
    check_kind("best", best, (Throws,))
    if np.ndim(best.speed):
        raise fail("best", "one throw", f"{len(best.speed)} throws", "Pass a single speed to aim.")
    if hits is not None:
        check_kind("hits", hits, (Hits,))
    path = picture_path(path)
    figure = blank(_WIDTH, 6.2)
    paths: Any = figure.add_subplot(2, 1, 1)
    ranges: Any = figure.add_subplot(2, 1, 2)
    speed = float(best.speed)
    flights = [("farthest", float(best.angle), float(best.t))] if best.ok else []
    if hits is not None:
        flights += [("hit", *each) for each in zip(hits.angles, hits.times, strict=True)]
    for i, (name, angle, t) in enumerate(flights):
        colour = PALETTE[i % len(PALETTE)]
        label = f"{name}, {np.degrees(angle):.4g} degrees"
        motion = simulate(launch(scene, angle, speed, t), samples=_SAMPLES)
        place = motion.r[:, 0] - np.asarray(scene.y0)[None, :2]
        paths.plot(place[:, 0], place[:, 1], color=colour, lw=1.8, label=label)
        ranges.plot(np.degrees(angle), place[-1, 0], "o", color=colour, ms=7, zorder=3)
    height = float(best.height)
    found = landings(scene, _COURSES, speed, _LOOK, height=height)
    ranges.plot(np.degrees(angle_of(_COURSES)), found.x, color=INK, lw=1.2)
    if hits is not None:
        paths.plot(hits.x, -height, "x", color=INK, ms=10, mew=2.2, label="target")
        ranges.axhline(hits.x, color=INK, lw=0.8, ls="--")
    paths.axhline(-height, color=INK, lw=0.8)
    (_, length), _, (_, rate), _ = scene.labels()
    paths.set(aspect="equal", xlabel=f"x [{length}]", ylabel=f"y [{length}]")
    shown = f"launch speed {speed:.6g} {rate}" if title is None else ""
    paths.set_title(heading(title, [scene], _WIDTH, shown), fontsize=10)
    ranges.set(xlabel="launch angle [degrees]", ylabel=f"lands at x [{length}]", xlim=(0, 180))
    ranges.set_xticks(range(0, 181, 30))
    style(paths)
    style(ranges)
    legend_below(figure, legend_entries(paths))
    return finish(figure, path)
