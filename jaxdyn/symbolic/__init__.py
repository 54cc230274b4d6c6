"""The equations of a scene, for people and for other programs: `jaxdyn.equations`.

`equations` prints the equations of motion of a scene, `deriving` derives them for each kind of
system, `following` those of a linkage described by its crank angle, `reactions` the forces of
constraints, `impacts` what an impact changes; `sections` has lines of print under titles. `linear`
has derivatives of the equations, as `matrices` of expressions. The expressions are those of
`algebra`; `reading` extracts them from the programs of a scene, and `symbols` names its quantities.
`trigonometry` and `simplifying` shorten them, `arranging` puts them in a readable order,
`typesetting` writes them as text, LaTeX and MathML, and `to_sympy` converts them to SymPy.

`parameters` has the numbers of a scene by name, `code` writes its rate as a function in another
language.

May import: `solvers`, `mechanisms`, `effects`, `scenes`.

To add a kind of system, write a function in `deriving` and a line in `derive`; to add a language, a
row of `LANGUAGES` in `code`; to add an output format, a `Style` in `typesetting`.
"""

from jaxdyn.symbolic.code import code
from jaxdyn.symbolic.equations import Equations
from jaxdyn.symbolic.linear import Linear
from jaxdyn.symbolic.matrices import Matrices
from jaxdyn.symbolic.parameters import Parameters, parameters, with_parameters

__all__ = ["Equations", "Linear", "Matrices", "Parameters", "code", "parameters", "with_parameters"]
