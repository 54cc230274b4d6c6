"""Models fitted to data: parameters and starts of a scene from measured times and entries.

`fit` is the call, `measurements` the tables that it takes, `segments` the motion cut into pieces,
`multiple_shooting` the least squares over all of them, `result` what is known then.

May import: `integrate`.

One more kind of measurement is one more case of `measurements.Column`.
"""

from jaxdyn.fitting.fit import fit
from jaxdyn.fitting.result import Fit, FitError, FitStatus, Prediction, Profile, Propagated

__all__ = ["Fit", "FitError", "FitStatus", "Prediction", "Profile", "Propagated", "fit"]
