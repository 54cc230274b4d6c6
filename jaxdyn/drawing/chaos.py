"""Pictures of maps of chaos: where motions are regular, and how fast others diverge."""

from typing import Any

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from jaxdyn.chaos.maps import ChaosMap
from jaxdyn.drawing.figures import blank, finished
from jaxdyn.files.image_files import picture_path

_MOST = 8.0  # of the MEGNO that is told apart: above it a motion is chaotic beyond doubt
_REGULAR = 2.0  # the MEGNO of quasi-periodic motions


def chaos_map(
    found: ChaosMap, path=None, *, names=("first", "second"), title: str | None = None
) -> Figure:
    """A picture of a map: regular motions in white to blue, chaotic ones in red.

    Args:
      found: what `chaos.chaos_map` returned, at least 2 x 2.
      path: file to write, .png, .pdf or .svg.
      names: its two numbers, with their units; the first goes up, the second across.
      title: its title.
    Raises:
      ValueError: `path` cannot be written.
    """
    path = picture_path(path)
    figure = blank(6.8, 4.8)
    ax: Any = figure.add_subplot()
    drawn = ax.pcolormesh(
        found.second,
        found.first,
        np.clip(found.mean, 0.0, _MOST),
        cmap="RdBu_r",
        norm=TwoSlopeNorm(_REGULAR, 0.0, _MOST),
        shading="nearest",
        rasterized=True,
    )
    # Where there is no motion.
    ax.set_facecolor("#d9d9d9")
    figure.colorbar(drawn, ax=ax, label="mean MEGNO (2: regular)", extend="max")
    ax.set(xlabel=names[1], ylabel=names[0], title=title or "")
    return finished(figure, path)
