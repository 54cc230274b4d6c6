"""Families of orbits: continuation, and the special points on them.

`continuation` poses a family, also one that closes upon itself, to the branch engine
(`jaxdyn.continuation.branch`), by the steps of `steps`; `family` has its members. `bifurcations`
finds folds, branch points, period doublings, torus points and Krein collisions, `shrinking` the
equilibria at which families end. `hopf` begins a family at a Hopf point of a family of equilibria,
`diagram` follows all families, or reads them from the file to which `checkpoint` writes members;
`graph` says which of them meet. `criticality` has the normal forms of bifurcations, from the series
of the return map; `special_orbits` has the derivatives of special points with respect to the
numbers of their scenes, `folds` those of the orbit at a fold, and `relocation` finds them again for
other numbers. `surface` has the set of all orbits near one, `sizes` the units in which it is
measured, `chains` the set of all chains of legs, and how far one is from grazing. `parameters`
makes a scene a function of one or two of its parameters.

May import: `analysis`.

To add a kind of motion, write a subclass of `surface.Surface`.

To add a kind of special point, write a `Kind` in `jaxdyn.continuation.kinds` and a test function in
`bifurcations` that changes sign there.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
