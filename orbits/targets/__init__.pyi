"""The names of orbits.targets: for type checkers, and for imports when they are first used."""

from . import aim as aim
from . import loops as loops
from .designing import Design as Design
from .designing import DesignOutcome as DesignOutcome
from .designing import design as design
from .minimising import Optimum as Optimum
from .minimising import OptimumOutcome as OptimumOutcome
from .minimising import minimise as minimise
