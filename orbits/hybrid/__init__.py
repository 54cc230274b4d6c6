"""Piecewise-smooth periodic motions: smooth legs joined by events.

`legs` defines such a motion, `phases` makes its legs of the phases of a scene, `equations` are its
equations, `search` solves them, `known` has distances from known ones, `margins` says how far it is
from grazing; `hopping` is the eccentric cylinder that rolls and hops without loss.

May import: `shooting`.

One more such motion is one file that makes the `Leg`s of a `HybridOrbit`, as `hopping` does.
"""

from orbits.hybrid import hopping

__all__ = ["hopping"]
