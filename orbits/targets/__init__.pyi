"""The names of orbits.targets: for type checkers, and for imports when they are first used."""

from . import aim as aim
from . import loops as loops
from .designs import Design as Design
from .designs import DesignOutcome as DesignOutcome
from .minima import Optimum as Optimum
from .minima import OptimumOutcome as OptimumOutcome
