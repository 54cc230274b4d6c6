"""The branch engine, and families of equilibria in a parameter.

`branch` follows any curve of solutions that is posed as a problem: it has the predictor, the
locator of special points, step control, and the loop, whose steps `checkpoint` saves in a file that
`loading` reads. `newton` is the corrector. `orbits` poses families of orbits, their curves in two
parameters and tori as such problems.

`equilibria` poses families of equilibria, followed by pseudo-arclength, and steps onto branches;
`family` holds their points. `special` finds folds, branch points and Hopf points between two points
of a family, by their defining equations in `defining`; `normal_forms` has their coefficients, and
`kinds` the names of all special points.

`two_parameters` poses curves of folds and Hopf points in two parameters by the equations of
`augmented`, `codimension_two` finds the special points on them, and `curve` holds both. All are
followed in the `units` of their points. `sensitivity` has derivatives of folds and Hopf points with
respect to the numbers of their scenes.

May import: `analysis`, `files`.

To add a kind of branch, write a `BranchProblem` with its `Chart` in a file of its own. To add a
kind of special point, write a `Kind` in `kinds`, its equations in `defining`, and a test in
`special`.
"""

from jaxdyn.continuation.curve import Curve, CurvePoint
from jaxdyn.continuation.equilibria import continue_equilibria, switch_branch
from jaxdyn.continuation.family import Equilibrium, EquilibriumFamily
from jaxdyn.continuation.kinds import CodimensionTwo, Kind
from jaxdyn.continuation.loading import load
from jaxdyn.continuation.sensitivity import DifferentiablePoint, differentiable
from jaxdyn.continuation.two_parameters import continue_curve

__all__ = [
    "CodimensionTwo",
    "Curve",
    "CurvePoint",
    "DifferentiablePoint",
    "Equilibrium",
    "EquilibriumFamily",
    "Kind",
    "continue_curve",
    "continue_equilibria",
    "differentiable",
    "load",
    "switch_branch",
]
