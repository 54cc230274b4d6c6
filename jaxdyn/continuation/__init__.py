"""Families of rest points in a parameter.

`equilibria` follows a family by pseudo-arclength and steps onto branches; `family` holds its
points. `special` finds folds, branch points and Hopf points between two points of a family, by
their defining equations in `defining`; `normal_forms` has their coefficients.

May import: `analysis`.

One more kind of special point is a `Kind` in `family`, its equations in `defining`, and a test in
`special`.
"""

from jaxdyn.continuation.equilibria import continue_equilibria, switch_branch
from jaxdyn.continuation.family import EquilibriumFamily, Kind, RestPoint

__all__ = [
    "EquilibriumFamily",
    "Kind",
    "RestPoint",
    "continue_equilibria",
    "switch_branch",
]
