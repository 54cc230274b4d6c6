"""Solvers: what `simulate` may be given as ``solver``.

- `Pair`: explicit, with a tolerance; the default. `NYSTROM12`, `VERNER9`, `DOPRI8`. With a step
  instead, for comparison: `EULER`, and the classic `RK4`.
- `Composition`: symplectic and explicit, with a step; long conservative runs without forces that
  depend on velocity. `VERLET`, `BLANES_MOAN6`, `KAHAN_LI8`, `SOFRONIOU_SPALETTA10`.
- `Gauss`: symplectic and implicit, with a step; long conservative runs of other scenes.
  `GAUSS8`, `GAUSS12`.
- `Stoermer`: explicit, with a tolerance; a few bodies whose forces do not depend on velocity, in
  0.6 to 0.9 of the time of a pair. `STOERMER14`, `STOERMER18`.
- `Taylor`: explicit, with a tolerance; scenes with short formulas, in a quarter to a half of the
  time of a pair. `TAYLOR8`, `TAYLOR12`, `TAYLOR16`, `TAYLOR20`.
- `Radau`: L-stable and implicit, with a tolerance; stiff scenes. `RADAU5`, `RADAU9`.
- An explicit Runge-Kutta solver of diffrax, such as ``diffrax.Tsit5()``; see `from_diffrax`.

`choice` decides which of them a scene gets. To add one, derive from `Method` in a new file.
"""

from jaxdyn.solvers.choice import Solver as Solver
from jaxdyn.solvers.choice import default_solver as default_solver
from jaxdyn.solvers.compositions import BLANES_MOAN6 as BLANES_MOAN6
from jaxdyn.solvers.compositions import KAHAN_LI8 as KAHAN_LI8
from jaxdyn.solvers.compositions import SOFRONIOU_SPALETTA10 as SOFRONIOU_SPALETTA10
from jaxdyn.solvers.compositions import VERLET as VERLET
from jaxdyn.solvers.compositions import Composition as Composition
from jaxdyn.solvers.exchange import DOPRI8 as DOPRI8
from jaxdyn.solvers.exchange import from_diffrax as from_diffrax
from jaxdyn.solvers.gauss import GAUSS8 as GAUSS8
from jaxdyn.solvers.gauss import GAUSS12 as GAUSS12
from jaxdyn.solvers.gauss import Gauss as Gauss
from jaxdyn.solvers.method import Advance as Advance
from jaxdyn.solvers.method import Method as Method
from jaxdyn.solvers.pairs import EULER as EULER
from jaxdyn.solvers.pairs import NYSTROM12 as NYSTROM12
from jaxdyn.solvers.pairs import RK4 as RK4
from jaxdyn.solvers.pairs import VERNER9 as VERNER9
from jaxdyn.solvers.pairs import Pair as Pair
from jaxdyn.solvers.radau import RADAU5 as RADAU5
from jaxdyn.solvers.radau import RADAU9 as RADAU9
from jaxdyn.solvers.radau import Radau as Radau
from jaxdyn.solvers.stepper import Stepper as Stepper
from jaxdyn.solvers.stepper import is_stiff as is_stiff
from jaxdyn.solvers.stoermer import STOERMER14 as STOERMER14
from jaxdyn.solvers.stoermer import STOERMER18 as STOERMER18
from jaxdyn.solvers.stoermer import Stoermer as Stoermer
from jaxdyn.solvers.taylor.method import TAYLOR8 as TAYLOR8
from jaxdyn.solvers.taylor.method import TAYLOR12 as TAYLOR12
from jaxdyn.solvers.taylor.method import TAYLOR16 as TAYLOR16
from jaxdyn.solvers.taylor.method import TAYLOR20 as TAYLOR20
from jaxdyn.solvers.taylor.method import Taylor as Taylor
from jaxdyn.solvers.taylor.method import has_series as has_series
