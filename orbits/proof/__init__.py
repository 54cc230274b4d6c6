"""Orbits to any number of digits, and proofs that they exist.

`closing_equations` states the closing equations as a square system and why a zero of it is an
orbit, `posing` sets that system up for an orbit, with the integrals of laws whose orbits all close
and the exact period of a periodic forcing. `refinement` solves it; `refined` has the record of the
result. `krawczyk` tests that a box has exactly one orbit, `theorems` proves the identities on which
this rests, the folder `stability` encloses the multipliers; `proving` combines these, and
distinguishes choreographies from other orbits, `certificate` has the record of the result, and
`checking` repeats the proof from a file.

May import: `analysis`. The results, `refined` and `certificate`, are plain data; all else needs
python-flint, ``pip install 'jaxdyn[proof]'``.

To add a number to many digits, write a field of `refined` and its calculation in `refinement`; to
add a theorem about an orbit, write a field of `certificate` and its proof in `proving`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
