"""The names of orbits.discovery: for type checkers, and for imports when they are first used."""

from . import libration as libration
from . import nearby as nearby
from . import plane as plane
from . import seeds as seeds
from .chunks import Starts as Starts
from .search import SearchResult as SearchResult
from .settling import Attractor as Attractor
from .settling import Basins as Basins
from .tipping import BasinFractions as BasinFractions
