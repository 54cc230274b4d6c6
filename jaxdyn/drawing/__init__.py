"""Pictures and animations of motions, and of what was found out about them.

Every function of a picture returns the `Figure`, and writes it where a path is given (.png, .pdf
or .svg); `animate` writes a .gif or .mp4. A file that cannot be written is refused before the
work.

Pictures: `space` and `projections` (paths), `series` (over time), `accuracy`, `charts` (stability),
`animation`. Their parts: `contents` (what there is to draw of a motion), `figures` (the look of all
pictures), `panels` (axes for motions), `solid` (axes in space), `curves`, `strokes`, `artists`,
`titles`. Nothing but the command lines and `orbits.drawing` imports this folder, since Matplotlib
takes long to load; ``import jaxdyn`` does not load it.

May import: `files`, `scenes`.

One more picture is one more file with a function ``name(found, path=None, *, title=None)`` that
checks its file by `image_files.picture_path`, draws on `figures.blank` with `figures.style`, and
ends in `figures.finished`; and one more line below.
"""

from jaxdyn.drawing.accuracy import judgement, work_precision
from jaxdyn.drawing.animation import animate
from jaxdyn.drawing.charts import stability_chart
from jaxdyn.drawing.contents import Paths, paths
from jaxdyn.drawing.projections import projections
from jaxdyn.drawing.series import time_series
from jaxdyn.drawing.space import trajectory
from jaxdyn.drawing.titles import caption

__all__ = [
    "Paths",
    "animate",
    "caption",
    "judgement",
    "paths",
    "projections",
    "stability_chart",
    "time_series",
    "trajectory",
    "work_precision",
]
