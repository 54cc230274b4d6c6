"""The names of orbits.tori: for type checkers, and for imports when they are first used."""

from .continuation import TorusFamily as TorusFamily
from .torus import Torus as Torus
from .torus import TorusOutcome as TorusOutcome
