"""Taylor series of the solution, from the formulas of a rate.

`formulas` splits a rate into scalars, which `graph` holds in normal form and `ordered` sorts for
computation; `recurrences` has the terms of each elementary function, `terms` what a step takes from
those of the solution, and `method` is the solver.

One more elementary function is a row of `FUNCTIONS` in `graph` and a rule in `recurrences`.
"""
