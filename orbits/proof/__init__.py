"""Orbits to any number of digits.

`closure` states the closing equations as a square system and why a zero of it is an orbit,
`posing` makes it for an orbit, `drives` finds the exact period of a drive, `refinement` solves it,
`multipliers` has the non-trivial eigenvalues; `refined` is the result as plain data.

May import: `analysis`. Nothing is imported before it is used: it needs python-flint,
``pip install 'jaxdyn[proof]'``.

One more number to many digits is a field of `refined` and its calculation in `refinement`.
"""
