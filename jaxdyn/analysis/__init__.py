"""Questions about a scene or a motion: what is conserved, where it rests, what is stable.

`energy`, `momenta`, `ledger` and `energy_change` look along a motion; `linearize` and `floquet`
decide what is stable, by `eigenvalues` (of a `monodromy` matrix); `equilibria` finds rest points,
and whether these are all (`rest_points`); `constraints` has forces of rods and the rank of ties;
`regularised` and `approaches` follow close encounters.

May import: `integrate`, `solvers`, `formulations`, `geometry`.

One more analysis is one file that takes a `Scene` or a `Trajectory`, and one line below.
"""

from jaxdyn.analysis import approaches as approaches
from jaxdyn.analysis import constraints as constraints
from jaxdyn.analysis import eigenvalues as eigenvalues
from jaxdyn.analysis import energy as energy
from jaxdyn.analysis import energy_change as energy_change
from jaxdyn.analysis import equilibria as equilibria
from jaxdyn.analysis import floquet as floquet
from jaxdyn.analysis import ledger as ledger
from jaxdyn.analysis import linearize as linearize
from jaxdyn.analysis import momenta as momenta
from jaxdyn.analysis import monodromy as monodromy
from jaxdyn.analysis import precession as precession
from jaxdyn.analysis import regularised as regularised
from jaxdyn.analysis import steady as steady
