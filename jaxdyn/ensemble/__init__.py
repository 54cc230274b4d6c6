"""Many motions at once, on all cores, each with its own steps.

`engine` has the calls (`run`, `stream`), `lanes` steps several motions side by side, `batches`
divides the work among threads and devices. `watches` are observers that measure along a motion or
end it early, and `crossings` has the observer that records the crossings of an event.

May import: `integrate`.

To add an observer, write a class in `watches`.
"""

from jaxdyn.ensemble import crossings, watches
from jaxdyn.ensemble.engine import run, stream

__all__ = ["crossings", "run", "stream", "watches"]
