"""Models fitted to data: parameters and initial states of a scene from measurements.

`fit` has the call, `measurements` the tables that it accepts, `segments` the segments of the
motion, `multiple_shooting` the least-squares problem over all of them, and `result` the result.

May import: `integrate`.

To add a kind of measurement, add a case to `measurements.Column`.
"""

from jaxdyn.fitting.fit import fit
from jaxdyn.fitting.result import Fit, FitError, FitStatus, Prediction, Profile, Propagated

__all__ = ["Fit", "FitError", "FitStatus", "Prediction", "Profile", "Propagated", "fit"]
