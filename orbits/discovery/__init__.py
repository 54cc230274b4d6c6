"""Looking for orbits where none is known: guesses, screening, searches over many starts.

`seeds` makes guesses, `screening` looks for close returns of many motions, `chunks` is the work
of one batch, `search` the whole, `journal` its file of results, `plane` the search among three
equal bodies, `figure_eight` the path from a rough guess to Montgomery's eight.

May import: `analysis` and what is below it.
"""

from orbits.discovery import nearby as nearby
from orbits.discovery import plane as plane
from orbits.discovery import seeds as seeds
