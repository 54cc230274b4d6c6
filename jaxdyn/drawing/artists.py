"""The moving shapes of a motion as Matplotlib artists: rods, springs, wheels, pins.

They are created once and then moved to a sample: the start for a picture, that of each frame for an
animation.
"""

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.path import Path

from jaxdyn.drawing.contents import Paths
from jaxdyn.drawing.figures import INK
from jaxdyn.drawing.panels import draw_lines
from jaxdyn.drawing.strokes import grounds, strokes

_SPRING = 0.022  # half width of a spring, relative to the widest side of the box
_AREAS = 1.4  # drawing order (zorder) of filled areas
ABOVE_AREAS = 1.5  # that of poses at other times, which a filled area must not hide
BODY = "#e6e9ee"
GROUND = "#8c8c8c"
_PIN = 22  # size of the marker of a pin [points]
#: A triangle with its tip at the pin's position, and the ground to which it is fixed.
HUNG = np.array([[0.0, 0.0], [-0.6, 0.9], [-1.0, 0.9], [1.0, 0.9], [0.6, 0.9], [0.0, 0.0]])


class Shapes:
    """The artists of all shapes of a motion on flat or solid axes."""

    def __init__(self, ax, drawn: Paths, box: np.ndarray):
        self.drawn, self.width = drawn, _SPRING * np.diff(box).max()
        draw_lines(ax, grounds(drawn), colors=GROUND, linewidths=1.6, zorder=0.6)
        fills = (("areas", BODY, _AREAS), ("solids", INK, 2.6)) if ax.name != "3d" else ()
        self._filled = {kind: _add_polygons(ax, colour, order) for kind, colour, order in fills}
        # In space the edges at the back are drawn too; lines are thinner to avoid clutter.
        width = 1.3 if ax.name == "3d" else 2.0
        self._lines = draw_lines(ax, [], colors=INK, linewidths=width, zorder=2.5)
        self._springs = draw_lines(ax, [], colors=INK, linewidths=1.1, zorder=2.4)
        marker = "s" if ax.name == "3d" else Path(HUNG * (1.0 if self._hangs() else -1.0))
        size = 6 if ax.name == "3d" else _PIN
        nowhere = [[]] * len(box)
        (self._pins,) = ax.plot(
            *nowhere, ls="", marker=marker, ms=size, c=INK, mfc="white", zorder=2
        )

    @property
    def all(self) -> list:
        """The moving artists, from back to front."""
        return [self._pins, *self._filled.values(), self._springs, self._lines]

    def show(self, sample: int) -> None:
        """Move all artists to their positions at a sample."""
        now = strokes(self.drawn, sample, self.width)
        for kind, artist in self._filled.items():
            artist.set_verts(getattr(now, kind))
        outlined = [] if self._filled else [*now.areas, *now.solids]
        self._lines.set_segments([*now.lines, *outlined])
        self._springs.set_segments(now.springs)
        solid = now.pins.shape[1] == 3
        (self._pins.set_data_3d if solid else self._pins.set_data)(*now.pins.T)

    def _hangs(self) -> bool:
        """Whether the parts held by the pins are below them."""
        pins = [at[..., 1].mean() for kind, at in self.drawn.shapes if kind == "pin" and at.size]
        return bool(pins) and np.mean(pins) >= self.drawn.xyz[..., 1].mean()


def draw_pose(ax, drawn: Paths, sample: int, **style) -> None:
    """Draw the outlines of bodies and rods at a sample, without springs and pins."""
    now = strokes(drawn, sample, 0.0)
    draw_lines(ax, [*now.lines, *now.areas, *now.solids], **style)


def _add_polygons(ax, colour: str, order: float) -> PolyCollection:
    """A collection, added to the axes, of closed polylines filled with a colour."""
    filled = PolyCollection([], facecolors=colour, edgecolors=INK, linewidths=1.3, zorder=order)
    return ax.add_collection(filled, autolim=False)
