"""Throws at a target, closed loops about a centre of force, and the design of orbits.

`aim` answers questions about throws (`hit`, `farthest`, `slowest`) by their range over all angles;
`launch` computes one throw, also one that ends at its terminal velocity, by the equations along the
launch in `thrown`. `loops` closes orbits about a centre, from the ratio of their radii.

`design` finds numbers of a scene for which a wanted condition holds for an orbit or a special
point, `minimise` those for which a quantity is least; `followed` is how both of them follow it.

May import: `families`.

To add a question, write a function in `aim` or `loops`, or a file beside them.
"""

from orbits.targets import aim, loops
from orbits.targets.design import Design, DesignOutcome, design
from orbits.targets.minimise import Optimum, OptimumOutcome, minimise

__all__ = [
    "Design",
    "DesignOutcome",
    "Optimum",
    "OptimumOutcome",
    "aim",
    "design",
    "loops",
    "minimise",
]
