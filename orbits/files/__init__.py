"""Orbits and families as files, and their verification.

`orbit_files` writes and reads orbits, `family_files` families; `encoding` turns an orbit into plain
JSON and back for both. `verify` recomputes the claims of an orbit file.

May import: `families`, `proof`.

One more format is one file that encodes to plain JSON and decodes it.
"""

from orbits.files import family_files

__all__ = ["family_files"]
