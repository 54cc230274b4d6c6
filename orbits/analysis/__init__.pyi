"""The names of orbits.analysis: for type checkers, and for imports when they are first used."""

from . import quantities as quantities
from .alignment import Match as Match
from .evidence import closure as closure
from .identity import Identity as Identity
from .report import Report as Report
from .report import as_json as as_json
from .same import match as match
from .sensitivity import DifferentiableOrbit as DifferentiableOrbit
from .words import syzygies as syzygies
from .words import word as word
