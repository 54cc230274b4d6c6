"""Throws at a target, and closed loops about a centre of force.

`aim` answers questions about throws (`hit`, `farthest`, `slowest`); `launch` is one throw, `thrown`
its equations along the launch, `ranges` the range over all angles, `steady_fall` the end of a long
throw at its terminal velocity. `loops` closes orbits about a centre, `shapes` finds the ratio of
their radii.

May import: `shooting`.

One more question is one function in `aim` or `loops`, or a file beside them.
"""

from orbits.targets import aim, loops

__all__ = ["aim", "loops"]
