"""A picture of entries of the state against time."""

import textwrap

import numpy as np
from matplotlib.figure import Figure

from jaxdyn import _checks
from jaxdyn.drawing.contents import why_stopped
from jaxdyn.drawing.figures import PALETTE, blank, finished, style
from jaxdyn.drawing.panels import WIDTH
from jaxdyn.image_files import picture_path
from jaxdyn.phases import Chain, pieces_of
from jaxdyn.simulate import Trajectory

_NOTE_WIDTH = 60  # characters


def time_series(motion: Trajectory | Chain, names=None, path=None) -> Figure:
    """A picture of entries of the state against time, one panel a unit.

    Args:
      motion: what `simulate` or `phases.run` returned.
      names: labels of the entries to draw, e.g. ``["x", "vx"]``; all of them if left out.
      path: file to write, .png, .pdf or .svg.
    Raises:
      ValueError: an unknown label, or a file that cannot be written.
    """
    path = picture_path(path)
    pieces = pieces_of(motion)
    scene = pieces[0].scene
    # Without units places and velocities are still drawn apart.
    units = dict(scene.system.labels())
    plain = all(unit == "1" for _, unit in scene.labels())
    names = list(units) if names is None else [_checks.choice("names", x, units) for x in names]
    if not names:
        raise _checks.fail("names", "one of " + ", ".join(units), "none")
    ts = np.concatenate([piece.ts for piece in pieces])
    values = {name: np.concatenate([piece[name] for piece in pieces]) for name in names}
    shown = list(dict.fromkeys(units[name] for name in names))
    figure = blank(WIDTH, 0.8 + 2.1 * len(shown))
    panels = figure.subplots(len(shown), sharex=True, squeeze=False)[:, 0]
    for ax, unit in zip(panels, shown, strict=True):
        style(ax)
        for i, name in enumerate(x for x in names if units[x] == unit):
            dash = ("-", "--", ":")[i // len(PALETTE) % 3]
            ax.plot(ts, values[name], dash, color=PALETTE[i % len(PALETTE)], lw=1.6, label=name)
        ax.margins(x=0)
        ax.set_ylabel("" if plain else f"[{unit}]")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    panels[-1].set_xlabel("t" if plain else "t [s]")
    panels[0].set_title(textwrap.fill(why_stopped(motion), _NOTE_WIDTH))
    return finished(figure, path)
