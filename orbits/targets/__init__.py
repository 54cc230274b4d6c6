"""Throws at a target, closed loops about a centre of force, numbers for which something holds.

`aim` answers questions about throws (`hit`, `farthest`, `slowest`) by their range over all angles;
`launch` is one throw, also one that ends at its terminal velocity, `thrown` its equations along the
launch. `loops` closes orbits about a centre, from the ratio of their
radii.

`design` finds numbers of a scene for which something wanted holds of an orbit or a special point.

May import: `analysis`.

One more question is one function in `aim` or `loops`, or a file beside them.
"""

from orbits.targets import aim, loops
from orbits.targets.design import Design, DesignOutcome, design

__all__ = ["Design", "DesignOutcome", "aim", "design", "loops"]
