"""The names of jaxdyn.drawing: for type checkers, and for imports when they are first used."""

from . import figures as figures
from .accuracy import judgement as judgement
from .accuracy import work_precision as work_precision
from .animation import animate as animate
from .bifurcations import bifurcation_curves as bifurcation_curves
from .bifurcations import equilibria as equilibria
from .charts import chaos_map as chaos_map
from .charts import stability_chart as stability_chart
from .contents import Paths as Paths
from .contents import paths as paths
from .eigenvalues import eigenvalues as eigenvalues
from .free_bodies import free_body as free_body
from .responses import bode as bode
from .series import time_series as time_series
from .sides import projections as projections
from .space import trajectory as trajectory
from .titles import caption as caption
