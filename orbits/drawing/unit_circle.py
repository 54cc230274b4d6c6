"""A picture of Floquet multipliers at the unit circle."""

import numpy as np
from matplotlib.figure import Figure

from jaxdyn._checks import check_first
from jaxdyn.drawing.figures import (
    INK,
    PALETTE,
    blank,
    finish,
    legend_below,
    legend_entries,
    mark,
    style,
)
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path
from orbits.analysis.stability import Stability

_SIDE = 4.2  # inches
_REACH = 1.6  # largest |multiplier| drawn in its place; larger ones are arrows with their sizes
_FURTHEST = 1.35  # distance of an arrow's head from 0


@check_first
def multipliers(found: Stability, path=None, *, title: str | None = None) -> Figure:
    """A picture of the multipliers of an orbit in the complex plane, with the unit circle.

    Multipliers far outside are shown by arrows towards them, with their absolute values; the
    partner of such a multiplier in an unstable pair lies close to 0.

    Args:
      found: what `orbits.stability` returned.
      path: file to write, .png, .pdf or .svg.
      title: its title; the verdict by default, "" for none.
    Raises:
      ValueError: `path` cannot be written.
    """
    path = picture_path(path)
    figure = blank(_SIDE, _SIDE + 0.5)
    ax = figure.add_subplot(aspect="equal")
    ax.set(xlim=(-_REACH, _REACH), ylim=(-_REACH, _REACH), xlabel="real", ylabel="imaginary")
    ax.set_title(found.verdict if title is None else readable(title), fontsize=10)
    style(ax)
    turn = np.linspace(0.0, 2 * np.pi, 400)
    ax.plot(np.cos(turn), np.sin(turn), color=INK, lw=1.2)
    values = found.nontrivial[np.isfinite(found.nontrivial)]
    near = values[np.abs(values) <= _REACH]
    ax.plot(near.real, near.imag, "o", color=PALETTE[0], ms=8, mec="white", label="multiplier")
    for value in values[np.abs(values) > _REACH]:
        _arrow(ax, value)
    handles = legend_entries(ax)
    if found.unit:
        ax.plot(1.0, 0.0, "o", color=PALETTE[1], ms=13, mfc="none", mew=1.6)
        handles.append(mark("o", f"{found.unit} equal to 1", mfc="none", mec=PALETTE[1], mew=1.6))
    legend_below(figure, handles)
    return finish(figure, path)


def _arrow(ax, value: complex) -> None:
    """An arrow from the unit circle towards a multiplier far outside, with its absolute value."""
    direction = np.array([value.real, value.imag]) / abs(value)
    look = {"arrowstyle": "-|>", "color": PALETTE[0], "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", _FURTHEST * direction, direction, arrowprops=look)
    beside = _FURTHEST * direction + 0.13 * np.array([-direction[1], direction[0]])
    ax.text(*beside, f"{abs(value):.3g}", color=INK, fontsize=9, ha="center", va="center")
