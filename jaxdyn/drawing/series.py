"""A picture of entries of the state against time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from jaxdyn import _checks
from jaxdyn._records.kinds import check_first
from jaxdyn._text import second
from jaxdyn.drawing.contents import why_stopped
from jaxdyn.drawing.curves import samples_reached, states
from jaxdyn.drawing.figures import GRID, PALETTE, blank, finish, style
from jaxdyn.drawing.panels import WIDTH
from jaxdyn.drawing.titles import heading
from jaxdyn.files.image_files import picture_path
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.trajectory import Trajectory


@check_first
def time_series(
    motion: Trajectory | HybridTrajectory,
    path=None,
    *,
    names: Sequence[str] | None = None,
    title: str | None = None,
) -> Figure:
    """A picture of entries of the state against time, one panel per unit.

    Args:
      motion: result of `simulate` or `simulate_phases`. Curves are smooth, see `curves`; phases are
        separated by lines.
      path: file to write, .png, .pdf or .svg.
      names: labels of the entries to draw, e.g. ``["x", "vx"]``; all of them by default.
      title: title of the picture; by default the scene with its numbers, "" for none.
    Raises:
      ValueError: `names` has an unknown label, `motion` is a batch, or `path` cannot be written.
    """
    path = picture_path(path)
    pieces = pieces_of(motion)
    scene = pieces[0].scene
    # Positions and velocities get separate panels, even without units.
    units = dict(scene.system.labels())
    shared = {units[name]: unit for name, unit in scene.labels()}
    plain = all(unit == "1" for unit in shared.values())
    names = list(units) if names is None else [_checks.choice("names", x, units) for x in names]
    if not names:
        raise _checks.fail("names", "one of " + ", ".join(units), "none")
    parts = [states(piece, samples_reached(piece), len(pieces)) for piece in pieces]
    ts, ys = (np.concatenate(both) for both in zip(*parts, strict=True))
    values = dict(zip(units, ys.T, strict=True))
    shown = list(dict.fromkeys(units[name] for name in names))
    lines = heading(title, [scene], WIDTH, why_stopped(motion))
    figure = blank(WIDTH, 0.8 + 2.1 * len(shown))
    panels = figure.subplots(len(shown), sharex=True, squeeze=False)[:, 0]
    for ax, unit in zip(panels, shown, strict=True):
        style(ax)
        for begin in (part[0][0] for part in parts[1:] if len(part[0])):
            ax.axvline(begin, color=GRID, lw=1.6, zorder=1)
        for i, name in enumerate(x for x in names if units[x] == unit):
            dash = ("-", "--", ":")[i // len(PALETTE) % 3]
            ax.plot(ts, values[name], dash, color=PALETTE[i % len(PALETTE)], lw=1.6, label=name)
        ax.margins(x=0)
        ax.set_ylabel("" if plain else f"[{shared[unit]}]")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    panels[-1].set_xlabel("t" if plain else f"t [{second(scene.labels())}]")
    panels[0].set_title(lines, fontsize=10)
    return finish(figure, path)
