"""The names of orbits.tori: for type checkers, and for imports when they are first used."""

from .continuation import TorusFamily as TorusFamily
from .record import Torus as Torus
from .record import TorusOutcome as TorusOutcome
