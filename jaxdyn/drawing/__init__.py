"""Pictures and animations of motions, and of what was found out about them.

Every function of a picture returns the `Figure`, and writes it where a path is given (.png, .pdf
or .svg); `animate` writes a .gif or .mp4. A file that cannot be written is refused before the
work.

Lives here: what there is to draw of a motion (`contents`), the look of all pictures (`figures`),
axes for motions (`panels`), and one file for each kind of picture. It may import everything of
`jaxdyn` but the command line and the course, and nothing imports it but those, since Matplotlib
takes long to load: ``import jaxdyn`` does not.

One more picture is one more file with a function ``name(found, path=None, *, title=None)`` that
checks its file by `image_files.picture_path`, draws on `figures.blank` with `figures.style`, and
ends in `figures.finished`; and one more line below.
"""

from jaxdyn.drawing.accuracy import judgement as judgement
from jaxdyn.drawing.accuracy import work_precision as work_precision
from jaxdyn.drawing.animation import animate as animate
from jaxdyn.drawing.charts import stability_chart as stability_chart
from jaxdyn.drawing.contents import Paths as Paths
from jaxdyn.drawing.contents import paths as paths
from jaxdyn.drawing.projections import projections as projections
from jaxdyn.drawing.series import time_series as time_series
from jaxdyn.drawing.space import trajectory as trajectory
from jaxdyn.drawing.titles import caption as caption
