"""Quasi-periodic motions: invariant tori about elliptic periodic orbits, and from torus points.

`torus` begins a torus with the Floquet vector of an orbit and solves it with as many modes as it
needs, by the equations of `invariance` for an invariant circle, which is a Fourier series of
`circle`; `continuation` poses families to the branch engine; `transverse` has the growth across.

May import: `families`.

To add a condition that singles out a torus of a family, write its row in `torus`, for
`invariance.Conditions`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
