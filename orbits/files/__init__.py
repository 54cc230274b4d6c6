"""Orbits and families as files, and their verification.

`orbit_files` writes and reads orbits and chains of legs, `family_files` families; `encoding` turns
an orbit into plain JSON and back for both, and refuses what is not an orbit; `jaxdyn.files.codec`
refuses all that is not plain data. `contents` returns the contents of a file, `verify` recomputes
the claims of an orbit file.

May import: `families`, `proof`.

To add a format, write one file that encodes to plain JSON and decodes it.
"""

from orbits.files import contents, family_files

__all__ = ["contents", "family_files"]
