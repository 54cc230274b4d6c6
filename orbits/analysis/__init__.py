"""Analysis of orbits: the stability, identity, derivatives and topology of an orbit.

`stability` finds the non-trivial multipliers of the `monodromy` matrix, from which the rules of
`jaxdyn/analysis/eigenvalues.py` decide what is stable; `chain` has the return map of a chain of
legs; `pieces` splits the period of either into smooth pieces. `identity` has the invariants of an
orbit, `same` and `alignment` compare two orbits, `words` describes their topology; `sensitivity`
has the derivatives of an orbit with respect to the numbers of its scene; `evidence` has independent
checks and the digits that they confirm, `report` collects all of it in a record; `quantities` has
the numbers by which families are drawn.

May import: `shooting`, `hybrid`.

To add an analysis, write one file that takes an `Orbit`, a line in ``orbits/__init__.pyi``, and a
claim in `report` if files and commands are to state it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
