"""Laws of motion: how forces move coordinates, one file a formulation.

`newton` (free points), `newton_euler` and `lagrange` (free coordinates), `constrained` (ties and
rolling conditions with multipliers), `rigid` (a body in space, its `attitude` as a quaternion or
a matrix), `prescribed` (a motion that is given). `mechanism` is what they share: coordinates and
the points they place. `routes` sets one machine up in several formulations.

May import: `scene`, `geometry`.
"""

from jaxdyn.formulations import attitude as attitude
from jaxdyn.formulations import constrained as constrained
from jaxdyn.formulations import lagrange as lagrange
from jaxdyn.formulations import mechanism as mechanism
from jaxdyn.formulations import newton as newton
from jaxdyn.formulations import newton_euler as newton_euler
from jaxdyn.formulations import prescribed as prescribed
from jaxdyn.formulations import rigid as rigid
from jaxdyn.formulations import routes as routes
