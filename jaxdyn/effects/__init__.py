"""What acts on material points, one file a family.

Each class is one effect; scenes are composed from them by ``+``. Positions and velocities
come as (n, d) arrays, masses as (n,); forces go back as (n, d). The numbers of an effect are
array leaves; which points it acts on is fixed when it is made.
"""

from jaxdyn.effects._parts import unless_zero as unless_zero
from jaxdyn.effects.central import CentralForce as CentralForce
from jaxdyn.effects.central import PowerLaw as PowerLaw
from jaxdyn.effects.drag import DryFriction as DryFriction
from jaxdyn.effects.drag import LinearDrag as LinearDrag
from jaxdyn.effects.drag import QuadraticDrag as QuadraticDrag
from jaxdyn.effects.external import ConstantForce as ConstantForce
from jaxdyn.effects.external import SinusoidalForce as SinusoidalForce
from jaxdyn.effects.external import StepForce as StepForce
from jaxdyn.effects.gravity import PairGravity as PairGravity
from jaxdyn.effects.gravity import UniformGravity as UniformGravity
from jaxdyn.effects.links import Dashpot as Dashpot
from jaxdyn.effects.links import Spring as Spring
from jaxdyn.effects.links import SpringNetwork as SpringNetwork
