"""Families of orbits: continuation, and what is special on them.

`continuation` walks, `family` holds the members, `bifurcations` finds folds, branch points,
period doublings and torus points, `surface` is the set of all orbits near one.

May import: `analysis` and what is below it.
"""

from orbits.families import parameters as parameters
