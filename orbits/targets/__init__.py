"""Throws at a target, and closed loops about a centre of force.

`aim` is the front door of throws (`hit`, `farthest`, `slowest`), `launch` one throw, `ranges` how
far it goes; `loops` closes orbits about a centre.

May import: `shooting` and what is below it.
"""

from orbits.targets import aim as aim
from orbits.targets import loops as loops
