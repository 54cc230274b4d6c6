"""Conditions for a motion to be periodic: closings, symmetries, further conditions.

`closings` has the ways to close (plainly, as a choreography, up to a rotation, by reversal), the
symmetries that they are made of, and the conditions that select a member of a family (its energy,
its period, an entry of the state); `given` checks the arguments of a search, and `sizes` has the
units in which entries of a state are compared.

May import: `jaxdyn`.

To add a closing, write a subclass of `Closing` in `closings`, or a function that makes one, and add
a line to ``orbits/__init__.pyi``.
"""

import lazy_loader

import jaxdyn._doors

_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__getattr__ = jaxdyn._doors.attribute_getter(__name__, _listed)
