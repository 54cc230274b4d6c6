"""The equations of a scene, for people and for other programs.

`parameters` has the numbers of a scene by name, `code` writes its rate as a function in another
language.

May import: `solvers`, `mechanisms`.

One more language is a row of `LANGUAGES` in `code`.
"""

from jaxdyn.symbolic.code import code
from jaxdyn.symbolic.parameters import Parameters, parameters

__all__ = ["Parameters", "code", "parameters"]
