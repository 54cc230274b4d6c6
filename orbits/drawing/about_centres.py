"""Pictures of motions about a centre: loops of closed orbits under power laws, and a rosette."""

import math
import textwrap
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxdyn import Scene, simulate
from jaxdyn._checks import check_first, fail
from jaxdyn.drawing.figures import INK, PALETTE, blank, finish, style
from jaxdyn.drawing.titles import heading
from jaxdyn.files.output_files import picture_path
from orbits.targets.loops import FewestLoops, fewest

_SAMPLES = 300
_EXPONENTS = (-2.9, -2.5, -2.0, -1.0, 0.0, 1.0, 3.0, 6.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
_FILLING = 12_000  # samples of a rosette of many loops
_TITLE = 80  # most characters in a line of a title
_ABOUT = "Motions about a centre of force r^n: apsidal angle and least number of loops"
_RING = 6.0  # inches, width of the picture of a rosette
_WIDEST = 2.0  # largest apsidal angle over pi in the picture
_ROOM = 0.06  # least distance of two labels, in units of that angle over pi


def loops(
    path=None,
    *,
    lowest: float = -2.9,
    highest: float = 1000.0,
    most: int = 6,
    title: str | None = None,
) -> Figure:
    """A picture of the apsidal angle of power laws r^n, and of the least number of loops.

    The upper panel shows the range of orbits between circles and lines, with the fractions turns /
    loops at which they close; the lower one shows the number of loops of the simplest of them. The
    axis of exponents is logarithmic in n + 3, to show both ends.

    Args:
      path: file to write, .png, .pdf or .svg.
      lowest: first exponent, > -3.
      highest: last exponent.
      most: largest number of loops of the fractions that are marked.
      title: its title; a description by default, "" for none.
    Raises:
      ValueError: not -3 < `lowest` < `highest`, or `path` cannot be written.
    """
    path = picture_path(path)
    if not -3 < lowest < highest:
        raise fail("lowest", f"above -3 and below highest = {highest:g}", lowest)
    n = np.unique([*np.geomspace(lowest + 3, highest + 3, _SAMPLES) - 3, -2.0, -1.0, 1.0])
    found = fewest(n[(n >= lowest) & (n <= highest)])
    figure = blank(6.8, 7.2)
    angles: Any = figure.add_subplot(2, 1, 1)
    counts: Any = figure.add_subplot(2, 1, 2, sharex=angles)
    circle, line, shade = PALETTE[0], PALETTE[1], "#dce9f2"
    angles.fill_between(found.n, found.circle, found.line, color=shade, lw=0, label="between")
    angles.plot(found.n, found.circle, color=circle, lw=1.8, label="near circles, 1 / sqrt(n + 3)")
    angles.plot(found.n, found.line, color=line, lw=1.8, label="near lines")
    _draw_fractions(angles, found, most)
    for law, name in ((-2.0, "gravity"), (1.0, "spring")):
        if lowest <= law <= highest:
            angles.plot(law, 1 / math.sqrt(law + 3), "o", color=INK, ms=6, zorder=3)
            look = {"textcoords": "offset points", "fontsize": 9}
            angles.annotate(name, (law, 1 / math.sqrt(law + 3)), (6, 6), **look)
    shown = _ABOUT if title is None else title
    angles.set_title(textwrap.fill(shown, _TITLE), fontsize=10)
    angles.set(ylabel="apsidal angle / pi", ylim=(0.0, _WIDEST))
    counts.plot(found.n, found.loops, ".", color=circle, ms=3)
    counts.set(xlabel="exponent n of the force r^n", ylabel="least number of loops", yscale="log")
    counts.set_xscale("function", functions=(_from_edge, _to_edge))
    ticks = [n for n in _EXPONENTS if lowest <= n <= highest]
    counts.set_xticks(ticks, [f"{n:g}" for n in ticks])
    counts.set_xlim(lowest, highest)
    counts.set_yticks([1, 2, 3, 5, 10, 20, 50], ["1", "2", "3", "5", "10", "20", "50"])
    counts.set_ylim(0.8, 60.0)
    angles.legend(loc="upper right", frameon=False)
    style(angles)
    style(counts)
    return finish(figure, path)


@check_first
def rosette(scene: Scene, path=None, title: str | None = None) -> Figure:
    """A picture of a motion about a centre and of the ring that it fills unless it closes.

    Args:
      scene: scene made by `orbits.targets.loops.rosette`; the motion over its span is drawn.
      path: file to write, .png, .pdf or .svg.
      title: its title, such as why it does not close; the scene with its numbers by default, ""
        for none.
    Raises:
      ValueError: `path` cannot be written.
    """
    path = picture_path(path)
    motion = simulate(scene, samples=_FILLING)
    x, y = np.asarray(motion["x"]), np.asarray(motion["y"])
    radii = np.hypot(x, y)
    figure = blank(_RING, 1.1 * _RING)
    ax: Any = figure.add_subplot(1, 1, 1)
    ax.plot(x, y, color=PALETTE[0], lw=0.7)
    turn = np.linspace(0.0, 2 * np.pi, _SAMPLES)
    for radius in (radii.min(), radii.max()):
        ax.plot(radius * np.cos(turn), radius * np.sin(turn), color=PALETTE[1], lw=1.8)
    ax.plot(0.0, 0.0, "+", color=INK, ms=10, mew=2)
    ax.plot(x[0], y[0], "o", color=INK, ms=6, zorder=3)
    ax.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    ax.set_title(heading(title, [scene], _RING), fontsize=10)
    style(ax)
    return finish(figure, path)


def _from_edge(n):
    """The scale of exponents on the axis, which begins at -3: bounded motions need n > -3."""
    return np.log(np.maximum(np.asarray(n, float) + 3, 1e-300))


def _to_edge(place):
    return np.exp(place) - 3


def _draw_fractions(ax, found: FewestLoops, most: int) -> None:
    """Mark turns / loops where orbits have them, with a label where there is room."""
    low, high = np.minimum(found.circle, found.line), np.maximum(found.circle, found.line)
    pairs = [(p, q) for q in range(1, most + 1) for p in range(1, int(_WIDEST * q))]
    named: list[float] = []
    for p, q in pairs:
        inside = (low < p / q) & (p / q < high)
        if math.gcd(p, q) > 1 or not inside.any():
            continue
        ax.plot(found.n, np.where(inside, p / q, np.nan), color=INK, lw=0.8)
        if min((abs(p / q - other) for other in named), default=1.0) < _ROOM:
            continue
        named.append(p / q)
        after = 2 * p > q  # on the side of the circles, where the range ends
        place = (found.n[inside][-1 if after else 0], p / q)
        look = {"ha": "left" if after else "right", "va": "bottom" if after else "top"}
        shift = (4, -3) if after else (-4, 2)
        ax.annotate(f"{p}/{q}", place, shift, textcoords="offset points", fontsize=8, **look)
