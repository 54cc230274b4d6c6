"""Conditions for a motion to be periodic: closings, symmetries, further conditions.

`closings` are the ways to close (plainly, as a choreography, up to a rotation, by reversal),
`symmetry` their parts, `conditions` select a member of a family (by energy, period, an entry of
the state), `given` checks the arguments of a search, `sizes` are the units in which entries of a
state are compared.

May import: `jaxdyn`.

One more closing is a subclass of `Closing` in `closings`, or a function that makes one, and a line
in ``orbits/__init__.pyi``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
