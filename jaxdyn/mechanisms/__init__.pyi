"""The names of jaxdyn.mechanisms: for type checkers, and for imports when they are first used."""

from . import bars as bars
from . import car as car
from . import cylinders as cylinders
from . import disk as disk
from . import euler_body as euler_body
from . import four_bar as four_bar
from . import guided as guided
from . import rods as rods
from . import skates as skates
from . import sticks as sticks
