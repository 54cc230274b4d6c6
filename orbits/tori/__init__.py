"""Quasi-periodic motions: invariant tori about elliptic periodic orbits.

`torus` begins one with the Floquet vector of an orbit, `refinement` solves it with as many modes as
it needs, by the equations of `invariance` on an invariant circle, a Fourier series of `circle`;
`record` is the result, `continuation` poses their family to the branch engine.

May import: `analysis`.

One more way to fix a torus in its family is one more row in `refinement`, for
`invariance.Conditions`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
