"""The accuracy of numbers, the cost of each digit, and how long digits stay correct.

`estimates` bounds the error of any solution without knowing the exact one (its arithmetic, which
`simulate(digits=...)` shares, is in `jaxdyn/integrate/errors.py`), `convergence` shows it for equal
steps and their halves, `end_error` gives the certain digits of a last state, `horizon` the time for
which chaos leaves any digits, and `work_precision` the error of any of the `quantities` against the
run time, which `timing` measures.

May import: `analysis`.

To add an estimate, write a function of a `Trajectory` in `estimates`, or in a file of its own, and
a line in ``__init__.pyi``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
