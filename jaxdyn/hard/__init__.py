"""Hard cases: scenes that break naive codes, each with numbers and their bounds.

`case` says what a case is, the folder `cases` has them, `collection` lists them all, `elliptic` has
integrals that several use.

May import: `accuracy`, `scenes`, `ensemble`.

One more case is one entry of `CASES` in the file of its topic in `cases`: a name, what must hold,
and a function that returns numbers with their bounds. Name and sentence are literals, which `jaxdyn
hard --list` reads without loading JAX. A new file is added to `TOPICS` in `collection`.
"""

from jaxdyn.hard.case import Case, Figure, Verdict, judge
from jaxdyn.hard.collection import CASES, chosen

__all__ = ["CASES", "Case", "Figure", "Verdict", "chosen", "judge"]
