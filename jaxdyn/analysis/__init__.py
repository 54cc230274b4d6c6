"""Questions about a scene or a motion: conserved quantities, equilibria, stability.

Along a motion there are `energy`, `momenta`, `work_by_effect`, `energy_change` (what changes it)
and `constraints` (tensions, reactions, rank); `regularised` and `approaches` follow close
encounters. At a state, `free_body` has all forces on each body. Stability is the subject of
`linearize`, `steady` (steady motions), `floquet` (driven scenes) and `precession`; `eigenvalues`
decides it, for orbits from the `monodromy` matrix. `equilibria` finds equilibria; the folder
`equilibrium_search` searches for them and proves that there are no others. `_roots` finds zeros of
functions of one variable, each in its bracket.

May import: `integrate`, `formulations`, `balls`.

To add an analysis, write a file with a function of a `Scene` or a `Trajectory`, and a line below.
"""

from jaxdyn.analysis import (
    approaches,
    constraints,
    eigenvalues,
    energy,
    energy_change,
    equilibria,
    floquet,
    free_body,
    linearize,
    momenta,
    monodromy,
    precession,
    regularised,
    steady,
    work_by_effect,
)

__all__ = [
    "approaches",
    "constraints",
    "eigenvalues",
    "energy",
    "energy_change",
    "equilibria",
    "floquet",
    "free_body",
    "linearize",
    "momenta",
    "monodromy",
    "precession",
    "regularised",
    "steady",
    "work_by_effect",
]
