"""Throws at a target, and closed loops about a centre of force.

`aim` answers questions about throws (`hit`, `farthest`, `slowest`) by their range over all angles;
`launch` is one throw, also one that ends at its terminal velocity, `thrown` its equations along the
launch. `loops` closes orbits about a centre, from the ratio of their
radii.

May import: `shooting`.

One more question is one function in `aim` or `loops`, or a file beside them.
"""

from orbits.targets import aim, loops

__all__ = ["aim", "loops"]
