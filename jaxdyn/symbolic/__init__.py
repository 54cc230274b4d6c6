"""The equations of a scene, for people and for other programs: `jaxdyn.equations`.

`equations` has what a scene's equations of motion look like in print, `deriving` derives them for
each kind of system, `following` those of a linkage by its crank; `sections` are lines of print
under titles. `linear` and `matrices` have their derivatives. They are made of expressions of
`algebra`, which `reading` takes from the programs of a scene; `symbols` says what its quantities
are called. `trigonometry` and `simplifying` shorten them, `arranging` puts them in a readable
order, `typesetting` writes them as text, LaTeX and MathML, `to_sympy` hands them to SymPy.

`parameters` has the numbers of a scene by name, `code` writes its rate as a function in another
language.

May import: `solvers`, `mechanisms`, `effects`.

One more kind of system is a function in `deriving` and a line in `derive`; one more language a row
of `LANGUAGES` in `code`; one more way of writing a `Style` in `typesetting`.
"""

from jaxdyn.symbolic.code import code
from jaxdyn.symbolic.equations import Equations
from jaxdyn.symbolic.linear import Linear
from jaxdyn.symbolic.matrices import Matrices
from jaxdyn.symbolic.parameters import Parameters, parameters, with_parameters

__all__ = ["Equations", "Linear", "Matrices", "Parameters", "code", "parameters", "with_parameters"]
