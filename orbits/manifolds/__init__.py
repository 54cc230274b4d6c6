"""Stable and unstable manifolds of periodic orbits and equilibria.

`manifold` chooses how far from an orbit strands begin and follows them, `directions` has the
tangents in which they begin, `strands` is the result. `connecting` is the call that finds
connections, `connection` the result. `between_equilibria` finds those of equilibria, and chooses
where their ends lie; `splitting` has the invariant subspaces of the linearisation as functions of a
parameter. `between_orbits` finds those of orbits, where strands cross on a section. `links` solves
both.

May import: `families`.

One more kind of object that has manifolds is one more function in `directions`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
