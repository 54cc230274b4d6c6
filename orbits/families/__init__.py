"""Families of orbits: continuation, and the special points on them.

`continuation` poses a family to the branch engine (`jaxdyn.continuation.branch`), by the steps of
`steps`, also one that closes upon itself; `family` holds its members. `bifurcations` finds folds,
branch points, period doublings, torus points and Krein collisions, `shrinking` the equilibria at
which families end. `hopf` begins a family at a Hopf point of a family of equilibria, `diagram`
follows all of them, `graph` says which of them meet. `checkpoint` keeps members in a file, which
`loading` reads. `criticality` has the normal forms of bifurcations, from the series of the return
map, `sensitivity` the derivatives of special points by the numbers of their scenes. `surface` is
the set of all orbits near one, `lengths` the units in which it is measured, `chains` that of all
chains of legs. `parameters` makes a scene a function of one or two of its parameters.

May import: `analysis`.

One more kind of motion is a class of `surface.Surface`.

One more kind of special point is a `Kind` in `jaxdyn.continuation.kinds`, and a function in
`bifurcations` that changes sign there.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
