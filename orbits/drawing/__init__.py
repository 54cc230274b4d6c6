"""Pictures of periodic orbits, of families of them, of throws and of closed loops.

Lives here: one file for each kind of picture, made of the parts of `jaxdyn.drawing` and by its
rules. It may import everything of `orbits` but the command line, and nothing imports it but that.
"""

from orbits.drawing.about_centres import loops as loops
from orbits.drawing.about_centres import rosette as rosette
from orbits.drawing.families import family as family
from orbits.drawing.periodic import orbits as orbits
from orbits.drawing.throwing import throws as throws
