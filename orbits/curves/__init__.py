"""Curves of special orbits in two parameters.

`following` poses folds, branch points, period doublings and torus points to the branch engine, by
the equations of `extended` in the units of `units`, and finds the points of codimension two
between two; `steps` makes a point with its multipliers and tests, and `curve` holds all;
`checkpoint` keeps them in a file, and reads it.

May import: `families`.

One more kind of curve is its closing equations in `extended` and its first vectors in `following`;
one more kind of special point is a `CodimensionTwo` and a test in `steps`.
"""

import jaxdyn._doors
from jaxdyn.continuation.kinds import CodimensionTwo
from orbits.curves.checkpoint import load
from orbits.curves.curve import OrbitCurve, OrbitCurvePoint

__all__ = ["CodimensionTwo", "OrbitCurve", "OrbitCurvePoint", "load"]

#: Renamed in version 0.3.
_RENAMED = {"Curve": "OrbitCurve", "CurvePoint": "OrbitCurvePoint"}
__getattr__ = jaxdyn._doors.attribute_getter(__name__, renamed=_RENAMED)
