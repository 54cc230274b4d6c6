"""The names of orbits.manifolds: for type checkers, and for imports when they are first used."""

from .connection import Connection as Connection
from .connection import ConnectionOutcome as ConnectionOutcome
from .manifold import Manifold as Manifold
