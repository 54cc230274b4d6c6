"""The public names of the studies: for type checkers, and for imports when they are first used."""

from . import rod_or_spring as rod_or_spring
from . import satellite_claims as satellite_claims
from . import sleeping_top as sleeping_top
from . import upright as upright
