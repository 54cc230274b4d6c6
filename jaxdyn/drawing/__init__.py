"""Pictures and animations of motions and of results about them.

Every function of a picture returns the `Figure`, and writes it where a path is given (.png, .pdf
or .svg); `animate` writes a .gif or .mp4. A path that cannot be written raises before the work
starts.

Pictures: `space` and `sides` (paths), `series` (over time), `accuracy`, `charts` (stability,
chaos), `bifurcations`, `eigenvalues`, `fits`, `responses` (Bode plots), `animation`, `free_bodies`
(forces on each body). Their parts: `contents` (what a picture of a motion shows), `figures` (the
look of all pictures), `panels` (axes for motions), `solid` (axes in space), `curves`, `strokes`,
`artists`, `titles`. Only the command lines and `orbits.drawing` import this folder, since
Matplotlib is slow to load; ``import jaxdyn.drawing`` does not load it.

May import: `files`, `scenes`, `chaos`, `continuation`, `fitting`, `vibration`.

To add a picture, write a file with a function ``name(found, path=None, *, title=None)`` that checks
its path by `output_files.picture_path`, draws on `figures.blank` with `figures.style` and ends with
`figures.finish`, and add a line in ``__init__.pyi``.
"""

import lazy_loader

import jaxdyn._doors

_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__getattr__ = jaxdyn._doors.attribute_getter(__name__, _listed)
