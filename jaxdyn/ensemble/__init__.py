"""Many motions at once, on all cores, each with its own steps; what is watched on the way.

`engine` has the calls (`run`, `stream`), `lanes` steps several motions side by side, `batches`
divides the work, `watches` are what is measured or ends a motion early.

May import: `integrate`, `solvers`.
"""

from jaxdyn.ensemble import watches as watches
from jaxdyn.ensemble.engine import run as run
from jaxdyn.ensemble.engine import stream as stream
