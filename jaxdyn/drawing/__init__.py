"""Pictures and animations of motions and of results about them.

Every function of a picture returns the `Figure`, and writes it where a path is given (.png, .pdf
or .svg); `animate` writes a .gif or .mp4. A path that cannot be written raises before the work
starts.

Pictures: `space` and `projections` (paths), `series` (over time), `accuracy`, `charts` (stability,
chaos), `bifurcations`, `fits`, `responses` (Bode plots), `animation`, `free_body` (forces on each
body). Their parts: `contents` (what a picture of a motion shows), `figures` (the look of all
pictures), `panels` (axes for motions), `solid` (axes in space), `curves`, `strokes`, `artists`,
`titles`. Only the command lines and `orbits.drawing` import this folder, since Matplotlib is slow
to load; ``import jaxdyn`` does not load it.

May import: `files`, `scenes`, `chaos`, `continuation`, `fitting`.

To add a picture, write a file with a function ``name(found, path=None, *, title=None)`` that checks
its path by `output_files.picture_path`, draws on `figures.blank` with `figures.style` and ends with
`figures.finish`, and add a line below.
"""

from jaxdyn.drawing.accuracy import judgement, work_precision
from jaxdyn.drawing.animation import animate
from jaxdyn.drawing.bifurcations import bifurcation_curves, equilibria
from jaxdyn.drawing.charts import chaos_map, stability_chart
from jaxdyn.drawing.contents import Paths, paths
from jaxdyn.drawing.free_body import free_body
from jaxdyn.drawing.projections import projections
from jaxdyn.drawing.responses import bode
from jaxdyn.drawing.series import time_series
from jaxdyn.drawing.space import trajectory
from jaxdyn.drawing.titles import caption

__all__ = [
    "Paths",
    "animate",
    "bifurcation_curves",
    "bode",
    "caption",
    "chaos_map",
    "equilibria",
    "free_body",
    "judgement",
    "paths",
    "projections",
    "stability_chart",
    "time_series",
    "trajectory",
    "work_precision",
]
