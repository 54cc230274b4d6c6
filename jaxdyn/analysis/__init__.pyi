"""The names of jaxdyn.analysis: for type checkers, and for imports when they are first used."""

from . import approaches as approaches
from . import constraints as constraints
from . import eigenvalues as eigenvalues
from . import elements as elements
from . import energy as energy
from . import energy_change as energy_change
from . import equilibria as equilibria
from . import floquet as floquet
from . import free_body as free_body
from . import kepler as kepler
from . import linearize as linearize
from . import momenta as momenta
from . import monodromy as monodromy
from . import precession as precession
from . import regularized as regularized
from . import steady as steady
from . import work_by_effect as work_by_effect
from .elements import orbital_elements as orbital_elements
