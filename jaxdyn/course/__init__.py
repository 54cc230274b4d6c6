"""The course: which public names answer which of its 61 problems.

The folder `problems` has the table of them all. Problems whose answer is a study of its own:
`rod_or_spring` (21), `upright` (29), `satellite_claims` (57), `sleeping_top` (59, 61).

May import: `accuracy`, `scenes`; and `orbits`.

One more answer is a name in the row of its problem in `problems`; a longer one is a file of its own
and one line below.
"""

from jaxdyn.course import rod_or_spring, satellite_claims, sleeping_top, upright
from jaxdyn.course.problems import PROBLEMS, Problem

__all__ = ["PROBLEMS", "Problem", "rod_or_spring", "satellite_claims", "sleeping_top", "upright"]
