"""The names of jaxdyn.geometry: for type checkers, and for imports when they are first used."""

from . import balance as balance
from . import euler as euler
from . import frames as frames
from . import indices as indices
from . import inertia as inertia
from . import kinematics as kinematics
from . import rotations as rotations
from . import vectors as vectors
