"""Hard cases: scenes that break naive codes, each with numbers and their bounds.

`case` defines what a case is, the folder `cases` has the cases, `collection` lists them all, and
`elliptic` has integrals that several of them use.

May import: `accuracy`, `scenes`, `ensemble`.

To add a case, write an entry of `CASES` in the file of its topic in `cases`: a name, a sentence
that says what must hold, and a function that returns numbers with their bounds. Name and sentence
are literals, which `jaxdyn hard --list` reads without loading JAX. A new file is added to `TOPICS`
in `collection`.
"""

from jaxdyn.hard.case import Case, Figure, Verdict, judge
from jaxdyn.hard.collection import CASES, chosen

__all__ = ["CASES", "Case", "Figure", "Verdict", "chosen", "judge"]
