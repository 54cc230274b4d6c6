"""Taylor series of the solution, from the formulas of a rate (`solvers.formulas`).

`terms` has the terms of each elementary function, by recurrences, and says what a step takes from
those of the solution; `method` is the solver.

To add an elementary function, add it to `solvers.formulas`, and write a rule in `terms`.
"""
