"""Pictures of periodic orbits, of families of them, of throws and of closed loops.

`periodic` draws orbits, `families` families, `diagrams` bifurcation diagrams, `graphs` the graphs
of families that meet, `throwing` throws, `about_centres` closed loops, `manifolds` stable and
unstable manifolds, `sections` surfaces of section, `tori` invariant tori, `responses` frequency
responses and backbone curves, `unit_circle` multipliers, `basin_maps` basins of attraction. All use
the parts of `jaxdyn.drawing` and follow its rules. Only the command line and what notebooks show
import this folder, since Matplotlib is slow to load. `pages` writes the pages on which orbits run.

May import: `discovery`, `files`, `manifolds`, `responses`, `sections`, `targets`, `tori`.

To add a picture, write a file with one function, and a line below.
"""

import jaxdyn._doors
from orbits.drawing.about_centres import loops, rosette
from orbits.drawing.basin_maps import basin_fractions, basins
from orbits.drawing.diagrams import diagram
from orbits.drawing.families import family
from orbits.drawing.graphs import graph
from orbits.drawing.manifolds import manifold
from orbits.drawing.periodic import orbits
from orbits.drawing.responses import backbone, frequency_response
from orbits.drawing.sections import section
from orbits.drawing.throwing import throws
from orbits.drawing.tori import torus
from orbits.drawing.unit_circle import multipliers

__all__ = [
    "backbone",
    "basin_fractions",
    "basins",
    "diagram",
    "family",
    "frequency_response",
    "graph",
    "loops",
    "manifold",
    "multipliers",
    "orbits",
    "rosette",
    "section",
    "throws",
    "torus",
]

__getattr__ = jaxdyn._doors.attribute_getter(__name__)
