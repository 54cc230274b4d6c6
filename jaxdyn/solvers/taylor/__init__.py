"""Taylor series of the solution, from the formulas of a rate (`solvers.formulas`).

`recurrences` has the terms of each elementary function, `terms` says what a step takes from those
of the solution, and `method` is the solver.

To add an elementary function, add it to `solvers.formulas`, and write a rule in `recurrences`.
"""
