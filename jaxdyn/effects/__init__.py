"""Effects: what acts on material points, with one file for each family.

`gravity` (uniform, and between all pairs of bodies), `drag` (drag and dry friction), `central`
(central forces), `links` (springs, dashpots, dampers, networks of springs), `matrices`
(linear forces on coordinates), `prescribed` (given functions of time). `_parts` checks what effects
have in common.

Positions and velocities are (n, d) arrays, masses (n,); forces are (n, d). The parameters of an
effect are array leaves; the points that it acts on are fixed when it is made.

May import: `jaxdyn`, that is the files at the top level.

To add an effect, write a subclass of `Effect` (`jaxdyn/system.py`) in the file of its family, with
a `potential` or a `force`, `velocity_dependent = False` if the force does not depend on velocity, a
`check` of its parameters, a `sketch` if it can be drawn, and a line in
``__init__.pyi``. A new family, such as magnetic fields, gets a file of its own.
"""

import lazy_loader

import jaxdyn._doors

_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__getattr__ = jaxdyn._doors.attribute_getter(__name__, _listed)
