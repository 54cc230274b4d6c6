"""Questions about a scene or a motion: what is conserved, where it rests, what is stable.

Along a motion: `energy`, `momenta`, `ledger` (work of each effect), `energy_change` (what changes
it), `constraints` (forces of rods, rank of ties); `regularised` and `approaches` follow close
encounters. Stability: `linearize`, `steady` (steady motions), `floquet` (driven scenes),
`precession`; `eigenvalues` decides it, for orbits from the `monodromy` matrix. `equilibria` finds
rest points; the folder `rest_points` searches for them and proves that there are no others.
`_roots` finds zeros of functions of one number, each in its bracket.

May import: `integrate`, `formulations`.

One more analysis is one file that takes a `Scene` or a `Trajectory`, and one line below.
"""

from jaxdyn.analysis import (
    approaches,
    constraints,
    eigenvalues,
    energy,
    energy_change,
    equilibria,
    floquet,
    ledger,
    linearize,
    momenta,
    monodromy,
    precession,
    regularised,
    steady,
)

__all__ = [
    "approaches",
    "constraints",
    "eigenvalues",
    "energy",
    "energy_change",
    "equilibria",
    "floquet",
    "ledger",
    "linearize",
    "momenta",
    "monodromy",
    "precession",
    "regularised",
    "steady",
]
