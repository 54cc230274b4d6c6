"""The names of jaxdyn.effects: for type checkers, and for imports when they are first used."""

from ._parts import unless_zero as unless_zero
from .central import CentralForce as CentralForce
from .central import PowerLaw as PowerLaw
from .drag import DryFriction as DryFriction
from .drag import LinearDrag as LinearDrag
from .drag import QuadraticDrag as QuadraticDrag
from .gravity import PairGravity as PairGravity
from .gravity import UniformGravity as UniformGravity
from .links import CubicSpring as CubicSpring
from .links import Damper as Damper
from .links import Dashpot as Dashpot
from .links import HingeDamper as HingeDamper
from .links import Spring as Spring
from .links import SpringNetwork as SpringNetwork
from .matrices import CirculatoryForce as CirculatoryForce
from .matrices import MatrixDamper as MatrixDamper
from .prescribed import ConstantForce as ConstantForce
from .prescribed import SinusoidalForce as SinusoidalForce
from .prescribed import StepForce as StepForce
