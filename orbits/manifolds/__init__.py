"""Stable and unstable manifolds of periodic orbits and equilibria.

`manifold` chooses how far from an orbit strands begin, follows them and has the record of the
result, `directions` has the tangents along which they begin. `connecting` has the call that finds
connections, `connection` the record of one. `between_equilibria` finds connections of equilibria,
by the invariant subspaces of the linearisation as functions of a parameter, and chooses where their
ends lie. `between_orbits` finds connections of orbits, where strands cross on a section. `links`
solves the equations of both.

May import: `families`.

To add a kind of object that has manifolds, write a function in `directions`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
