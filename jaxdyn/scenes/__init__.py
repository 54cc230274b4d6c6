"""Ready-made scenes, one file a family; `jaxdyn list` shows them with their parameters.

`disks` has a disk that rolls, `cylinders` the scenes, events and phases of cylinders that roll,
slip and fly, `walkers` mechanisms that walk down a slope, `impacts` driven bodies that hit
something, `corners` the phases of all scenes whose motions have corners, `triangular_well`
the Henon-Heiles model, `matrices` linear systems given by M, C and K, `restricted` massless bodies
in rotating frames. `catalogue` lists all scenes, `ready_made` has what their functions share, and
`switching` exchanges coordinates that become singular during a motion.

May import: `mechanisms`, `effects`, `integrate`.

To add a scene, write a function ``name(mass=1.0, ...)`` in the file of its family that returns a
`Scene` and is decorated with `ready_made()`; give the unit of each parameter in its docstring,
where `jaxdyn/cli/docstrings.py` reads it; add a line below; and, if the scene answers a problem of
the course, use it on a page of `jaxdyn/course`.
"""

import pkgutil

import lazy_loader

import jaxdyn._doors

# A scene loads the file of its family, not all mechanisms and phases; see `jaxdyn/__init__.py`.
_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_families = [module.name for module in pkgutil.iter_modules(__path__)]
__getattr__ = jaxdyn._doors.attribute_getter(__name__, _listed, folders=_families)
