"""The names of orbits.responses: for type checkers, and for imports when they are first used."""

from .backbone import Backbone as Backbone
from .resonances import Resonance as Resonance
from .response import FrequencyResponse as FrequencyResponse
