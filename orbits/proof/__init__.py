"""Orbits to any number of digits, and proofs that they exist.

`closing_equations` states the closing equations as a square system and why a zero of it is an
orbit, `posing` sets that system up for an orbit, with the integrals of laws whose orbits all close
and the exact period of a periodic forcing. `refinement` solves it; `refined` is the result.
`krawczyk` tests that a box has exactly one zero, `theorems` proves the identities that this rests
on, the folder `stability` encloses the multipliers; `proving` does all of it, and tells
choreographies from other orbits, `certificate` is the result, and `checking` does it again from a
file.

May import: `analysis`. The results, `refined` and `certificate`, are plain data; all else needs
python-flint, ``pip install 'jaxdyn[proof]'``.

One more number to many digits is a field of `refined` and its calculation in `refinement`; one more
theorem about an orbit is a field of `certificate` and its proof in `proving`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
