"""The course: which public names answer which of its 61 problems.

The folder `problems` has the table of them all. Problems whose answer is a study of its own:
`rod_or_spring` (21), `upright` (29), `satellite_claims` (57), `sleeping_top` (59, 61).

May import: `accuracy`, `scenes`; and `orbits`.

One more answer is a name in the row of its problem in `problems`; a longer one is a file of its own
and one line below.
"""

import lazy_loader

# `jaxdyn list --problems` shows the table without loading JAX.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
