"""Orbits and families as files, and their verification.

`orbit_files` and `family_files` are the formats, `verify` writes, reads and verifies.

May import: `families`.

One more format is one file that encodes to plain JSON and decodes it.
"""

from orbits.files import family_files

__all__ = ["family_files"]
