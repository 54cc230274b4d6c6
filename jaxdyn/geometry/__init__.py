"""Tools that need no scene: vectors, rotations, inertia, kinematics.

`vectors` (cross products, lines, tetrahedra), `indices` (index notation), `rotations` (axis and
angle, rotation vectors, quaternions, and their matrices), `frames` (components in two bases, what
makes a matrix a rotation), `euler` (Euler angles), `inertia` (of boxes, cylinders and other bodies,
and principal axes), `balance` (static and dynamic balancing), `kinematics` (motion seen from moving
frames).

May import: `jaxdyn`, that is the files at the top level.

To add a tool, write a function in the file of its topic. It takes lists as well as arrays
(`@arrays`), works under jit, vmap and grad, and says in its docstring what happens in degenerate
cases.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
