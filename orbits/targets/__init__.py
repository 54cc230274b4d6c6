"""Throws at a target, closed loops about a centre of force, and the design of orbits.

`aim` answers questions about throws (`hit`, `farthest`, `slowest`) by their range over all angles;
`launch` computes one throw, also one that ends at its terminal velocity, by the equations along the
launch in `thrown`. `loops` closes orbits about a centre, from the ratio of their radii.

`designs` finds numbers of a scene for which a wanted condition holds for an orbit or a special
point, `minima` those for which a quantity is least; `followed` is the continuation that both of
them use, by its `derivatives`.

May import: `families`.

To add a question, write a function in `aim` or `loops`, or a file beside them with a line in
``__init__.pyi``.
"""

import lazy_loader

# A page that aims does not wait for the search of orbits, which the others import.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
