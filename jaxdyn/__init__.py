"""jaxdyn."""

from jaxdyn import energy as energy
from jaxdyn import events as events
from jaxdyn import scenes as scenes
from jaxdyn._config import configure as configure
from jaxdyn.scene import Effect as Effect
from jaxdyn.scene import Points as Points
from jaxdyn.scene import Scene as Scene
from jaxdyn.scene import System as System
from jaxdyn.simulate import Trajectory as Trajectory
from jaxdyn.simulate import simulate as simulate
from jaxdyn.status import IntegrationError as IntegrationError
from jaxdyn.status import Status as Status
