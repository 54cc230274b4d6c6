"""Pictures of periodic orbits side by side, to one scale, with the velocities at the start."""

import math
from collections.abc import Iterable, Sequence

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jaxdyn import _checks, simulate
from jaxdyn.drawing.contents import indices_of, paths, places
from jaxdyn.drawing.figures import INK, blank, finish, legend_below, mark, path_entries
from jaxdyn.drawing.panels import (
    apart,
    colours,
    draw_jumps,
    draw_marks,
    draw_paths,
    draw_starts,
    jumps,
    limits,
    panel,
    size,
)
from jaxdyn.drawing.series import time_series
from jaxdyn.drawing.solid import fill
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from orbits.closing.sizes import sizes
from orbits.families.family import first_scene
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit

_SAMPLES = 600
_RTOL = 1e-10
_BACK = 1e-6  # a state that differs from the start by less, in sizes, has returned to it
_FEW_STEPS = 5000
_PANEL = 4.6  # inches wide
_COLUMNS = 4  # most panels in a row
_ARROW = 0.16  # longest arrow as a share of the widest direction
_AT_REST = 1e-9  # speed at a start that counts as zero, in widths of the picture per period
_LINE = 0.22  # [inches] per line of the titles


def orbits(
    found: Orbit | HybridOrbit | Sequence[Orbit | HybridOrbit],
    path=None,
    titles: Sequence[str] | None = None,
    *,
    entries: Sequence[str] | None = None,
    title: str | None = None,
) -> Figure:
    """Pictures of orbits in rows of four, each over one period and all to one scale.

    Dots mark where bodies start, and arrows their velocities there, to one scale per picture. A
    jump at the end of a chain's leg is dashed.

    Args:
      found: an orbit, or several.
      path: file to write, .png, .pdf or .svg.
      titles: title of each orbit; it may have several lines.
      entries: names of two or three entries of the state to draw, instead of what moves in space or
        of all entries of a plain rate.
      title: title of the figure; by default the scene with the numbers that all orbits share, ""
        for none.
    Raises:
      ValueError: `found` is empty or has orbits in different dimensions, `titles` has another
        length, or `path` cannot be written.
      IntegrationError: an orbit cannot be integrated over its period.
    """
    path = picture_path(path)
    found = list(found) if isinstance(found, Iterable) else [found]
    titles = _check_titles(found, titles)
    motions = [_one_period(orbit) for orbit in found]
    drawn = [paths(motion, entries) for motion in motions]
    if len({one.labels for one in drawn}) > 1:
        raise _checks.fail(
            "found", "orbits in one space", "orbits in several", "Draw them separately."
        )
    equal = drawn[0].equal
    within = np.concatenate([places(one, shapes=False) for one in drawn])
    width = np.ptp(within, axis=0).max()
    arrows = [_velocities(orbit, width, entries) if equal else None for orbit in found]
    tips = [sum(arrow) for arrow in arrows if arrow is not None]
    box = limits(np.concatenate([within, *tips]), equal)
    columns = min(len(drawn), _COLUMNS)
    rows = math.ceil(len(drawn) / columns)
    width, height = _grid(rows, columns, box, equal)
    above = heading(title, [first_scene(orbit) for orbit in found], width)
    figure = blank(width, height + _LINE * (_lines(above) + rows * max(map(_lines, titles))))
    figure.suptitle(above, fontsize=10)
    back = [
        apart(one, 0, -1) and _comes_back(orbit, motion)
        for one, orbit, motion in zip(drawn, found, motions, strict=True)
    ]
    each = zip(arrows, drawn, titles, back, strict=True)
    for i, (arrow, one, own, jumps_back) in enumerate(each):
        ax = panel(figure, one, box, (rows, columns, i + 1))
        ax.set_title(own, fontsize=10)
        draw_marks(ax, one)
        draw_paths(ax, one, colours(one))
        draw_starts(ax, one, colours(one))
        if jumps_back:
            draw_jumps(ax, [(one.xyz[-1], one.xyz[0])], colours(one))
        if arrow is not None:
            _draw_velocities(ax, *arrow)
    most = max(drawn, key=lambda one: one.xyz.shape[1])
    marks = [mark("o", "start")]
    if any(arrow is not None for arrow in arrows):
        marks.append(mark(r"$\rightarrow$", "velocity there"))
    if any(map(jumps, drawn)) or any(back):
        marks.append(Line2D([], [], color=INK, lw=1.0, ls="--", label="jump"))
    legend_below(figure, [*path_entries(most.names, colours(most)), *marks])
    fill(figure)
    return finish(figure, path)


def overview(orbit) -> Figure:
    """The untitled picture of an orbit in a notebook, for orbits that take at most seconds.

    Where nothing moves in space, it shows the entries of the state over time.

    Raises:
      IntegrationError: the motion takes more than a few thousand steps.
    """
    motion = _one_period(orbit, max_steps=_FEW_STEPS)
    try:
        return orbits([orbit], title="")
    except ValueError:  # more than three entries, and no points
        return time_series(motion, title="")


def _comes_back(orbit, motion) -> bool:
    """Whether the last change of a chain leads to its start; otherwise the motion advances."""
    if not isinstance(orbit, HybridOrbit):
        return False
    scene = first_scene(orbit)
    off = np.abs(np.asarray(scene.system.difference(motion.y, orbit.y0)))
    return bool((off <= _BACK * sizes(scene)).all())


def _one_period(orbit, **options):
    if isinstance(orbit, HybridOrbit):
        return orbit.trajectory(_SAMPLES // len(orbit.legs) + 2)
    scene = orbit.scene.starting(orbit.y0, orbit.period)
    return simulate(scene, samples=_SAMPLES, rtol=_RTOL, solver=orbit.solver, **options)


def _check_titles(found: Sequence, titles) -> Sequence[str]:
    if not found:
        raise _checks.fail("found", "at least one orbit", "none")
    if titles is None:
        return [""] * len(found)
    if len(titles) != len(found):
        raise _checks.fail("titles", f"one for each of {len(found)} orbits", len(titles))
    return titles


def _lines(text: str) -> int:
    return text.count("\n") + 1 if text else 0


def _grid(rows: int, columns: int, box: np.ndarray, equal: bool) -> tuple[float, float]:
    """Width and height [in] of a figure with rows and columns of panels, without titles."""
    width, height = size(box, equal)
    scale = 1.0 if columns == 1 or (len(box) == 3 and rows == 1) else _PANEL / width
    # The legend and the labels do not shrink with the panels.
    return columns * scale * width, rows * scale * (height - 1) + 1


def _velocities(
    orbit, width: float, entries: Sequence[str] | None
) -> tuple[np.ndarray, np.ndarray] | None:
    """Positions (n, d) of the bodies at the start, and their velocities scaled to arrows.

    Where entries of the state are drawn, as for a scene without bodies, their velocity is the rate.
    """
    scene, t = first_scene(orbit), jnp.zeros(())
    y0 = jnp.asarray(orbit.y0)
    drawn = indices_of(entries, scene) or range(len(y0))
    start = (y0[None, list(drawn)], scene.rate(t, y0)[None, list(drawn)])
    if scene.has_points and entries is None:
        start = scene.points(t, y0)[:2]
    r, v = map(np.asarray, start)
    fastest = np.linalg.norm(v, axis=1).max()
    # At rest the velocity is only rounding, which has no direction.
    moves = fastest > _AT_REST * width / float(orbit.period)
    return (r, v * (_ARROW * width / fastest)) if moves else None


def _draw_velocities(ax, r: np.ndarray, arrows: np.ndarray) -> None:
    """Draw arrows (2-D or 3-D) from where the bodies start."""
    look = {
        "units": "inches",
        "width": 0.022,
        "angles": "xy",
        "scale_units": "xy",
        "scale": 1,
        "zorder": 3.5,
    }
    look = look if r.shape[1] == 2 else {"arrow_length_ratio": 0.3, "lw": 1.8}
    for place, arrow in zip(r, arrows, strict=True):
        ax.quiver(*place[:, None], *arrow[:, None], color=INK, **look)
