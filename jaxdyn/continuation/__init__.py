"""Families of equilibria in a parameter.

`equilibria` follows a family by pseudo-arclength and steps onto branches; `family` holds its
points. `special` finds folds, branch points and Hopf points between two points of a family, by
their defining equations in `defining`; `normal_forms` has their coefficients.

`two_parameters` follows curves of folds and Hopf points in two parameters by the equations of
`augmented`, `codimension_two` finds the special points on them, and `curve` holds both;
`second_lyapunov` is the coefficient of Bautin points.

`walk` takes the steps along what is followed, in the `units` of its points; `checkpoint` keeps them
in a file, which `loading` reads.

May import: `analysis`, `files`.

One more kind of special point is a `Kind` in `family`, its equations in `defining`, and a test in
`special`.
"""

from jaxdyn.continuation.curve import CodimensionTwo, Curve, CurvePoint
from jaxdyn.continuation.equilibria import continue_equilibria, switch_branch
from jaxdyn.continuation.family import Equilibrium, EquilibriumFamily, Kind
from jaxdyn.continuation.loading import load
from jaxdyn.continuation.two_parameters import continue_curve

__all__ = [
    "CodimensionTwo",
    "Curve",
    "CurvePoint",
    "Equilibrium",
    "EquilibriumFamily",
    "Kind",
    "continue_curve",
    "continue_equilibria",
    "load",
    "switch_branch",
]
