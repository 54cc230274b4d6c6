"""The names of jaxdyn.formulations: for type checkers, and for imports when they are first used."""

from . import attitude as attitude
from . import choice as choice
from . import constrained as constrained
from . import extended as extended
from . import functions as functions
from . import lagrange as lagrange
from . import linear as linear
from . import mechanism as mechanism
from . import newton as newton
from . import newton_euler as newton_euler
from . import ode as ode
from . import polar as polar
from . import prescribed as prescribed
from . import rigid as rigid
from . import structure as structure
from . import xpp as xpp
from . import xpp_expressions as xpp_expressions
