"""Orbits and families as files, and their verification.

`orbit_files` and `family_files` are the formats, `verify` writes, reads and re-derives.

May import: `families`, `analysis` and what is below them.
"""

from orbits.files import family_files as family_files
