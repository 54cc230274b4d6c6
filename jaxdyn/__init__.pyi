"""The public names of jaxdyn: what type checkers see, and what `jaxdyn._lazy` imports."""

from jaxdyn import accuracy as accuracy
from jaxdyn import analysis as analysis
from jaxdyn import course as course
from jaxdyn import drawing as drawing
from jaxdyn import effects as effects
from jaxdyn import ensemble as ensemble
from jaxdyn import files as files
from jaxdyn import formulations as formulations
from jaxdyn import geometry as geometry
from jaxdyn import hard as hard
from jaxdyn import integrate as integrate
from jaxdyn import mechanisms as mechanisms
from jaxdyn import scenes as scenes
from jaxdyn import solvers as solvers
from jaxdyn._config import configure as configure
from jaxdyn.analysis.equilibria import equilibria as equilibria
from jaxdyn.analysis.linearize import linearize as linearize
from jaxdyn.analysis.linearize import modes as modes
from jaxdyn.integrate.events import until as until
from jaxdyn.integrate.phases import Chain as Chain
from jaxdyn.integrate.simulation import Trajectory as Trajectory
from jaxdyn.integrate.simulation import simulate as simulate
from jaxdyn.integrate.simulation import solve as solve
from jaxdyn.scene import Effect as Effect
from jaxdyn.scene import Points as Points
from jaxdyn.scene import Scene as Scene
from jaxdyn.scene import System as System
from jaxdyn.status import IntegrationError as IntegrationError
from jaxdyn.status import Status as Status

__version__: str
