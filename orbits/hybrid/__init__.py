"""Piecewise-smooth periodic motions: smooth legs joined by events.

`legs` defines such a motion, `phases` makes its legs of the phases of a scene, `equations` are its
equations, `search` solves them, also unlike known ones, `margins` says how far it is from grazing.

May import: `shooting`.

One more such motion is a function that makes the `Leg`s of a `HybridOrbit` and calls `find_hybrid`,
as `hop` in page 38 of the course does.
"""

import jaxdyn

#: Moved in version 0.3.
__getattr__ = jaxdyn._doors.attribute_getter(
    __name__, modules={"hopping": "jaxdyn.course.eccentric_cylinder"}
)
