"""The names of jaxdyn.integrate: for type checkers, and for imports when they are first used."""

from . import events as events
from . import phases as phases
from .event_search.all_crossings import Crossings as Crossings
