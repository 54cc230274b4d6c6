"""The names of orbits.families: for type checkers, and for imports when they are first used."""

from . import checkpoint as checkpoint
from . import family as family
from . import parameters as parameters
from .criticality import Criticality as Criticality
from .diagram import Diagram as Diagram
from .diagram import load as load
from .family import Family as Family
from .graph import Graph as Graph
from .special_orbits import SpecialOrbit as SpecialOrbit
