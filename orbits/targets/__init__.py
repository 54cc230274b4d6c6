"""Throws at a target, and closed loops about a centre of force.

`aim` answers questions about throws (`hit`, `farthest`, `slowest`) by their range over all angles;
`launch` is one throw, `thrown` its equations along the launch, `steady_fall` the end of a long
throw at its terminal velocity. `loops` closes orbits about a centre, from the ratio of their
radii.

May import: `shooting`.

One more question is one function in `aim` or `loops`, or a file beside them.
"""

from orbits.targets import aim, loops

__all__ = ["aim", "loops"]
