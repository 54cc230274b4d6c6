"""A picture of surfaces of section, side by side."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn._checks import check_first, fail
from jaxdyn._text import with_unit
from jaxdyn.analysis.energy import change
from jaxdyn.drawing.figures import INK, blank, finish, shades, style
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from jaxdyn.integrate.events import Reaches
from orbits.sections.completion import least_energies
from orbits.sections.coordinates import entry
from orbits.sections.tables import SectionPoints

_PANEL, _ABOVE = 4.4, 0.7  # inches
_GRID = 300  # points in each direction, for the edge of the allowed region
_MARGINS = 0.1 * 1.5 ** np.arange(9)  # margins of a box around the points, relative to its size
#: An extent below the first share of the position of the points, or below the second share of the
#: entries with the same unit, is rounding.
_RESOLVED, _ROUNDING = 1e-6, 1e-8
_SAME_ENERGY = 1e-9  # largest difference of energies on one energy surface, relative to their terms
_POINTS = 4000  # number of points in a panel above which dots are smaller
_MOST_PANELS = 6
_DECIMALS = 12  # decimals of an energy that are kept, so that rounding about 0 is not shown


@check_first
def section(
    points: SectionPoints | Sequence[SectionPoints], path=None, *, titles=(), title=None
) -> Figure:
    """A picture of the crossings of a section: a dot for each, in one colour for each start.

    Where all starts have the same energy, and this determines the state at a point of the section,
    the edge of the energetically allowed region is drawn.

    Args:
      points: what `orbits.section` returned, or several of them, drawn side by side.
      path: file to write, .png, .pdf or .svg.
      titles: title of each panel; the energy by default.
      title: title of the picture; the scene with its numbers by default, "" for none.
    Raises:
      ValueError: `path` cannot be written, there are no crossings or too many panels, or the
        number of titles is not that of the panels.
    """
    path = picture_path(path)
    tables = [points] if isinstance(points, SectionPoints) else list(points)
    if not 1 <= len(tables) <= _MOST_PANELS:
        raise fail("points", f"one to {_MOST_PANELS} sections", len(tables))
    if titles and len(titles) != len(tables):
        raise fail("titles", f"{len(tables)} of them", len(titles))
    if not any(table.counts.any() for table in tables):
        raise fail("points", "crossings", "none", tables[0].message)
    width = _PANEL * len(tables)
    figure = blank(width, _PANEL + _ABOVE)
    for i, table in enumerate(tables):
        ax: Any = figure.add_subplot(1, len(tables), i + 1)
        _panel(ax, table)
        energy = None if titles else _one_energy(table)
        shown = "" if energy is None else f"E = {round(energy, _DECIMALS) + 0.0:.6g}"
        ax.set_title(titles[i] if titles else shown, fontsize=10)
    about = heading(title, [table.scene for table in tables], width)
    if about:
        figure.suptitle(about, fontsize=10)
    return finish(figure, path)


def _panel(ax, table: SectionPoints) -> None:
    size = 1.5 if np.sum(table.counts) > _POINTS else 4.0
    for qp, colour in zip(table.qp, shades(len(table.qp)), strict=True):
        ax.plot(*qp.T, ".", color=colour, ms=size, mec="none")
    units = dict(table.scene.labels())
    across, up = (with_unit(name, units[name]) for name in table.names)
    ax.set(xlabel=across, ylabel=up)
    if table.counts.any():
        _edge(ax, table)
        _widen(ax, table)
    style(ax)


def _widen(ax, table: SectionPoints) -> None:
    """Widen the axis of a coordinate that is constant, which would otherwise show its rounding."""
    low, high, constant = _extent(table)
    for axis, ends, wide in zip("xy", zip(low, high, strict=True), constant, strict=True):
        if wide and np.ptp(getattr(ax.dataLim, f"interval{axis}")) < ends[1] - ends[0]:
            ax.set(**{f"{axis}lim": ends})


def _extent(table: SectionPoints) -> tuple[np.ndarray, ...]:
    """(2,) lower and upper ends of the points, and whether these differ only by rounding."""
    low, high = np.nanmin(table.qp, axis=(0, 1)), np.nanmax(table.qp, axis=(0, 1))
    middle, half = (low + high) / 2, (high - low) / 2
    units = dict(table.scene.labels())
    alike = [[unit == units[name] for unit in units.values()] for name in table.names]
    size = np.array([np.nanmax(np.abs(table.ys[..., same])) for same in alike])
    constant = half <= np.maximum(_RESOLVED * np.abs(middle), _ROUNDING * size)
    half = np.where(constant, np.where(size > 0, size, 1.0) / 2, half)
    return middle - half, middle + half, constant


def _one_energy(table: SectionPoints) -> float | None:
    """The common energy of all starts; None if there is none."""
    known = np.isfinite(table.energies) & (table.counts > 0)
    if not known.any():
        return None
    levels = change(table.scene, table.ts[known, 0], table.ys[known, 0])
    return float(np.mean(table.energies[known])) if levels.relative <= _SAME_ENERGY else None


def _edge(ax, table: SectionPoints) -> None:
    """Draw the edge of the allowed region, where that is known."""
    energy, event = _one_energy(table), table.event
    if energy is None or not isinstance(event, Reaches):
        return
    shown = tuple(entry(table.scene, "names", name) for name in table.names)
    seen = []
    for margin in _MARGINS:
        q, p = _box(table, margin)
        flat = np.stack([q.ravel(), p.ravel()], axis=-1)
        least = least_energies(table.scene, event, (shown[0], shown[1]), flat)
        if least is None:
            return
        least = np.asarray(least).reshape(q.shape)
        outside = least > energy
        whole = outside[[0, -1]].all() and outside[:, [0, -1]].all()
        seen += [(q, p, least)] * int(outside.any())
        if whole:
            break
    # Draw in the box that holds the whole region; if the region is open, in the first box that
    # shows an edge.
    for q, p, least in seen[-1:] if whole else seen[:1]:
        ax.contour(q, p, least, levels=[energy], colors=INK, linewidths=1, linestyles="solid")


def _box(table: SectionPoints, margin: float) -> tuple[np.ndarray, ...]:
    """The coordinates of a grid over the points."""
    low, high, _ = _extent(table)
    room = margin * (high - low)
    ends = zip(low - room, high + room, strict=True)
    return tuple(np.meshgrid(*(np.linspace(a, b, _GRID) for a, b in ends)))
