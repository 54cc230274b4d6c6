"""Pictures of basins of attraction: a map with the attractors, and fractions over a parameter."""

from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from jaxdyn import _checks, _text
from jaxdyn.drawing.figures import INK, PALETTE, blank, finish, style
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path
from orbits.discovery.settling import CHAOTIC, Basins
from orbits.discovery.tipping import BasinFractions

_NOWHERE = "#ffffff"
_SIZE = 6.0  # [in]
_MOST_POINTS = 4000  # most points of a chaotic attractor that are drawn


def basins(found: Basins, path=None, *, title: str | None = None) -> Figure:
    """A picture of the basins over two entries of the start.

    Starts that reach no attractor are white; attractors are drawn where they are within the grid.

    Args:
      found: the result of `orbits.basins`, for a grid of two entries.
      path: file to write, .png, .pdf or .svg.
      title: its title; the scene's name by default.
    Raises:
      ValueError: the grid does not have two entries, or `path` cannot be written.
    """
    path = picture_path(path)
    if len(found.axes) != 2:
        raise _checks.fail("found", "basins over two entries", len(found.axes))
    figure = blank(_SIZE + 0.5, _SIZE + 0.4 * (1 + len(found.attractors)))
    ax = figure.subplots()
    style(ax)
    colours = [PALETTE[i % len(PALETTE)] for i in range(len(found.attractors))]
    x, y = found.axes
    mesh = ListedColormap([_NOWHERE, *colours])
    ax.pcolormesh(
        x,
        y,
        found.labels.T + 1,
        cmap=mesh,
        vmin=-0.5,
        vmax=len(colours) + 0.5,
        alpha=0.75,
        rasterized=True,
        shading="nearest",
    )
    labels = [name for name, _ in found.entries]
    units = dict(found.entries)
    i, j = (labels.index(name) for name in found.names)
    for attractor in found.attractors:
        points = attractor.points[-_MOST_POINTS:]
        if attractor.kind == CHAOTIC:
            mark = {"ls": "", "marker": ".", "ms": 1.5, "mew": 0}
        elif len(points) > 99:
            mark = {"lw": 1.2}
        else:
            mark = {"ls": "", "marker": "o", "ms": 6, "mec": "white", "mew": 0.5}
        ax.plot(points[:, i], points[:, j], color=INK, **mark)
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
    across, up = (_text.with_unit(name, units[name]) for name in found.names)
    ax.set(xlabel=across, ylabel=up)
    shares = zip(found.attractors, found.fractions, found.bars, strict=False)
    names = [f"{a.said}: {100 * p:.1f} +- {100 * bar:.1f} %" for a, p, bar in shares]
    handles = [Patch(color=c, label=n, alpha=0.75) for c, n in zip(colours, names, strict=True)]
    if found.fractions[-1] > 0:
        handles.append(Patch(fc=_NOWHERE, ec=INK, label=f"none: {100 * found.fractions[-1]:.1f} %"))
    figure.legend(handles=handles, loc="outside lower center", frameon=False, fontsize=9)
    ax.set_title(found.title if title is None else readable(title), fontsize=10)
    return finish(figure, path)


def basin_fractions(found: BasinFractions, path=None, *, title: str | None = None) -> Figure:
    """A picture of the fractions of basins over a parameter, one band for each attractor.

    Args:
      found: the result of `orbits.basin_fractions`, for at least two values.
      path: file to write, .png, .pdf or .svg.
      title: its title; the name of the scene by default.
    Raises:
      ValueError: there is only one value, or `path` cannot be written.
    """
    path = picture_path(path)
    if len(found.values) < 2:
        raise _checks.fail("found", "at least two values", len(found.values))
    count = len(found.attractors)
    figure = blank(_SIZE + 0.5, _SIZE * 0.6 + 0.3 * (1 + count))
    ax = figure.subplots()
    style(ax)
    colours = [*(PALETTE[i % len(PALETTE)] for i in range(count)), _NOWHERE]
    first = [next(one for one in each if one is not None) for each in found.attractors]
    names = [*(f"{i}: {one.said}" for i, one in enumerate(first)), "none"]
    bands = ax.stackplot(found.values, 100 * found.fractions.T, colors=colours, alpha=0.75)
    for point in found.tipping:
        ax.axvspan(point.low, point.high, color=INK, alpha=0.12, lw=0)
    shown = range(count + (found.fractions[:, -1] > 0).any())
    handles = [Patch(fc=colours[i], ec=INK, label=names[i], alpha=0.75) for i in shown]
    figure.legend(handles=handles, loc="outside lower center", frameon=False, fontsize=9)
    for band in bands:
        band.set_edgecolor(INK)
        band.set_linewidth(0.8)
    ax.set(xlabel="parameter", ylabel="fraction of the starts [%]", ylim=(0, 100))
    ax.set(xlim=(found.values[0], found.values[-1]))
    ax.set_title(found.found[0].title if title is None else readable(title), fontsize=10)
    return finish(figure, path)
