"""The public names of jaxdyn: for type checkers, and for imports when they are first used."""

from . import accuracy as accuracy
from . import analysis as analysis
from . import chaos as chaos
from . import continuation as continuation
from . import drawing as drawing
from . import effects as effects
from . import ensemble as ensemble
from . import files as files
from . import fitting as fitting
from . import formulations as formulations
from . import geometry as geometry
from . import integrate as integrate
from . import mechanisms as mechanisms
from . import scenes as scenes
from . import solvers as solvers
from . import symbolic as symbolic
from . import vibration as vibration
from ._config import configure as configure
from ._info import info as info
from .accuracy.end_error import end_error as end_error
from .analysis.energy_change import energy_change as energy_change
from .analysis.equilibria import equilibria as equilibria
from .analysis.linearize import linearize as linearize
from .analysis.linearize import modes as modes
from .chaos.lyapunov import lyapunov_exponents as lyapunov_exponents
from .continuation.equilibria import continue_equilibria as continue_equilibria
from .continuation.two_parameters import continue_curve as continue_curve
from .files.loading import load as load
from .files.tables import read_csv as read_csv
from .fitting.fit import fit as fit
from .formulations.lagrange import lagrangian as lagrangian
from .formulations.ode import ode as ode
from .integrate.event_search.all_crossings import crossings as crossings
from .integrate.events import until as until
from .integrate.phases import HybridTrajectory as HybridTrajectory
from .integrate.simulation import simulate as simulate
from .integrate.simulation import solve as solve
from .integrate.trajectory import Trajectory as Trajectory
from .scene import Effect as Effect
from .scene import Scene as Scene
from .scene import System as System
from .status import IntegrationError as IntegrationError
from .status import Status as Status
from .symbolic.equations import equations as equations

__version__: str
