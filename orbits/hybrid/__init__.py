"""Piecewise-smooth periodic motions: smooth legs joined by events.

`legs` defines such a motion, `phases` makes its legs from the phases of a scene, `equations` has
its equations, and `search` solves them, also away from known solutions.

May import: `shooting`.

To add such a motion, write a function that makes the `Leg`s of a `HybridOrbit` and calls
`find_hybrid`, as `hop` on page 38 of the course does.
"""

import jaxdyn

#: The module that moved in version 0.3.
__getattr__ = jaxdyn._doors.attribute_getter(
    __name__, modules={"hopping": "jaxdyn.course.eccentric_cylinder"}
)
