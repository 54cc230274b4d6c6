"""How right a number is, what each digit costs, and how long digits last.

`estimates` judges any solution without the exact one, `convergence` by equal steps and their
halves, `end_error` tells the digits of a last state, `horizon` how long chaos leaves them,
`work_precision` measures error against time.

May import: `analysis` and what is below it.
"""

from jaxdyn.accuracy import convergence as convergence
from jaxdyn.accuracy import end_error as end_error
from jaxdyn.accuracy import horizon as horizon
from jaxdyn.accuracy import work_precision as work_precision
from jaxdyn.accuracy.estimates import by_halving as by_halving
from jaxdyn.accuracy.estimates import by_second_method as by_second_method
from jaxdyn.accuracy.estimates import by_tangents as by_tangents
from jaxdyn.accuracy.estimates import estimate as estimate
