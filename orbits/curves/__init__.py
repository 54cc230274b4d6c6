"""Curves of special orbits in two parameters.

`following` poses folds, branch points, period doublings and torus points to the branch engine, by
the equations of `extended` in the units of `units`, and finds the points of codimension two between
neighbours on a curve; `steps` makes a point with its multipliers and tests; `curve` has the records
of points and curves; `checkpoint` writes them to a file and reads it.

May import: `families`.

To add a kind of curve, write its equations in `extended` and its first vectors in `following`; to
add a kind of special point, write a `CodimensionTwo` and a test in `steps`.
"""

import jaxdyn._doors
from jaxdyn.continuation.kinds import CodimensionTwo
from orbits.curves.checkpoint import load
from orbits.curves.curve import OrbitCurve, OrbitCurvePoint

__all__ = ["CodimensionTwo", "OrbitCurve", "OrbitCurvePoint", "load"]

#: Renamed in version 0.3.
_RENAMED = {"Curve": "OrbitCurve", "CurvePoint": "OrbitCurvePoint"}
__getattr__ = jaxdyn._doors.attribute_getter(__name__, renamed=_RENAMED)
