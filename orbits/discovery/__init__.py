"""Discovery of orbits: guesses, screening, searches over many starts.

`seeds` makes guesses, `libration` those near libration points, `nearby` finds the orbit near a
scene's own motion, `several` all orbits to which a few guesses lead, `screening` finds close
returns of many motions, `chunks` processes one batch, `search` all of them, `journal` is the file
of results, `plane` the search among three equal bodies, `figure_eight` the path from a rough guess
to Montgomery's figure-eight. `basins` says to which attractor each start goes, `map_basins` that of
a map; `settling` is what they share, `tipping` how basins change along a parameter. `workers` packs
scenes for the processes of an executor.

May import: `analysis`.

To add a search, write a file that samples starts and calls `search`, as `plane` does.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
