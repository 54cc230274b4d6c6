"""The names of orbits.proof: for type checkers, and for imports when they are first used."""

from .certificate import Certificate as Certificate
from .refined import Refined as Refined
