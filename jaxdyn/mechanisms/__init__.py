"""Mechanisms: their geometry and masses. The equations of motion are derived in `formulations`.

`bars` (uniform bars hinged in a row: double and n-fold pendulums), `sticks` (one stick on a hinge
or a cart), `rods` (points joined by massless rods), `four_bar` (the four-bar linkage), `guided`
(masses on wires and in slots), `skates` (a planar body on skates), `car` (a car that brakes, seen
from above), `euler_body` (a rigid body by Euler angles), `disk` (a disk that rolls on the ground),
`cylinders` (the equations of a cylinder in each kind of contact).

May import: `formulations`.

To add a mechanism, write a file with a `Mechanism` (coordinates, points, ties), which then runs in
every formulation, or with a `System` of its own if no formulation fits, and add a line to
``__init__.pyi``. A ready-made scene of it belongs in `scenes`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
