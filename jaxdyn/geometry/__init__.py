"""Tools that need no scene: vectors, index notation, rotations, inertia, balancing, kinematics.

May import: the private helpers of `jaxdyn` only.

One more tool is a function in the file of its topic. It takes lists as well as arrays, works
under jit, vmap and grad, and says in its docstring what happens in degenerate cases.
"""

from jaxdyn.geometry import balance as balance
from jaxdyn.geometry import euler as euler
from jaxdyn.geometry import indices as indices
from jaxdyn.geometry import inertia as inertia
from jaxdyn.geometry import kinematics as kinematics
from jaxdyn.geometry import rotations as rotations
from jaxdyn.geometry import vectors as vectors
