"""Surfaces of section: where motions cross an event, again and again.

`completion` finds the velocity that a start on the section lacks from its energy, `tables` the
crossings of many starts (`orbits.section`), `maps` has the Poincare map as a differentiable
function, `records` writes crossings as JSON and CSV, `coordinates` says which entries of the state
are coordinates of a section.

May import: `analysis`.

To add a kind of section, write an event (`jaxdyn.integrate.events`), and in `coordinates` the entry
of the state that is fixed on it.
"""

from orbits.sections import coordinates, records
from orbits.sections.completion import Completed, complete
from orbits.sections.maps import PoincareMap, poincare_map
from orbits.sections.tables import SectionPoints

__all__ = [
    "Completed",
    "PoincareMap",
    "SectionPoints",
    "complete",
    "coordinates",
    "poincare_map",
    "records",
]
