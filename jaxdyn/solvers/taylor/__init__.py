"""Taylor series of the solution, from the formulas of a rate (`solvers.formulas`).

`recurrences` has the terms of each elementary function, `terms` says what a step takes from those
of the solution, and `method` is the solver.

One more elementary function is added to `solvers.formulas`, with a rule in `recurrences`.
"""
