"""Periodic motions with corners: legs joined by events, and the cylinder that hops for ever.

May import: `shooting` and what is below it.
"""

from orbits.hybrid import hopping as hopping
