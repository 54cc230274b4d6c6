"""A picture of the eigenvalues of equilibria over a parameter."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import linear_sum_assignment

from jaxdyn._checks import check_first
from jaxdyn._text import frequency_scale, with_unit
from jaxdyn.continuation.family import Equilibrium, EquilibriumFamily
from jaxdyn.continuation.special import EquilibriumChart
from jaxdyn.continuation.units import units_of
from jaxdyn.drawing.bifurcations import mark_special, with_special
from jaxdyn.drawing.figures import (
    INK,
    blank,
    finish,
    legend_below,
    legend_entries,
    shades,
    style,
)
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path

_POINTS = 200  # approximate number of equilibria in a picture


@check_first
def eigenvalues(
    family: EquilibriumFamily,
    path=None,
    *,
    parameter: str = "parameter",
    hertz: bool = False,
    title: str | None = None,
) -> Figure:
    """A picture of the eigenvalues of a family: rates of growth, and frequencies, of small motions.

    The equilibrium is stable where all rates of growth are negative; it flutters beyond a Hopf
    point, and diverges beyond a fold or a branch point. With a rotor's speed as the parameter, the
    frequencies are its Campbell diagram. Special points are marked.

    Args:
      family: result of `continue_equilibria` or `jaxdyn.continuation.switch_branch`.
      path: file to write, .png, .pdf or .svg.
      parameter: name of the parameter.
      hertz: whether frequencies are in Hz, or in turns per unit of time; growth is not changed.
      title: title of the picture.
    Raises:
      ValueError: `family` is something else, or `path` cannot be written.
    """
    path = picture_path(path)
    first = family.members[0]
    time = family.make(np.asarray(first.parameter)).in_units("s")
    scale, unit = frequency_scale(time, hertz=hertz)
    points = _refine(family)
    over = np.array([point.parameter for point in points])
    lines = _match([point.eigenvalues.values for point in points])
    # Of a complex pair only the line with the positive frequency is drawn.
    lines = lines[:, (lines.imag >= 0).any(axis=0)]
    parts = [(with_unit("growth", f"1/{time}" if time else ""), lines.real)]
    if (lines.imag > 0).any():
        frequencies = np.where(lines.imag > 0, scale * lines.imag, np.nan)
        parts.append((with_unit("frequency", unit), frequencies))
    figure = blank(6.8, 3.0 * len(parts))
    axes = figure.subplots(len(parts), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (name, values) in zip(axes, parts, strict=True):
        for line, colour in zip(values.T, shades(values.shape[1]), strict=True):
            if not np.isnan(line).all():
                ax.plot(over, line, color=colour, lw=1.6)
        ax.set(ylabel=name)
        style(ax)
    axes[0].axhline(0.0, color=INK, lw=0.8)
    axes[0].set_title(readable(title), fontsize=10)
    axes[-1].set(xlabel=parameter)
    if len(parts) > 1:
        axes[1].set_ylim(bottom=0.0)
    for point in family.special:
        mark_special(axes[0], point, 0.0)
        if not math.isnan(point.frequency):
            mark_special(axes[-1], point, scale * point.frequency)
    if family.special:
        legend_below(figure, legend_entries(axes[0]))
    return finish(figure, path)


def _refine(family: EquilibriumFamily) -> list[Equilibrium]:
    """The members and special points of a family, and equilibria between them."""
    points = with_special(family.members, family.special, lambda point: point.x)
    parts = math.ceil(_POINTS / len(points))
    found = []
    for a, b in itertools.pairwise(points):
        chart = EquilibriumChart(family.make, units_of(family.make, a))
        ends = chart.inward(a), chart.inward(b)
        inner = (chart.between(*ends, i / parts) for i in range(1, parts))
        found += [a, *(chart.outward(point) for point in inner if point is not None)]
    return [*found, points[-1]]


def _match(values: Sequence[np.ndarray]) -> np.ndarray:
    """(n, k) eigenvalues of n neighbours in an order in which each column changes the least."""
    found = [values[0][np.lexsort((values[0].real, -values[0].imag))]]
    for new in values[1:]:
        _, order = linear_sum_assignment(np.abs(found[-1][:, None] - new))
        found.append(new[order])
    return np.stack(found)
