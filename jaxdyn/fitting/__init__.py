"""Models fitted to data: parameters and initial states of a scene from measurements.

`fit` has the call for estimates with error bars, `training` that for networks, `problem` the
arguments that both have in common, `measurements` the tables that they accept, `segments` the
segments of the motion, `multiple_shooting` the least-squares problem over all of them, and `result`
the result of a fit.

May import: `integrate`.

To add a kind of measurement, add a case to `measurements.Column`.
"""

from jaxdyn.fitting.fit import fit
from jaxdyn.fitting.result import Fit, FitError, FitStatus, Prediction, Profile, Propagated
from jaxdyn.fitting.training import Training, TrainingStatus, train

__all__ = ["Fit", "FitError", "FitStatus", "Prediction", "Profile", "Propagated", "fit"]
__all__ += ["Training", "TrainingStatus", "train"]
