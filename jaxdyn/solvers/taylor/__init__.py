"""Taylor series of the solution, from the formulas of a rate (`solvers.formulas`).

`terms` has the terms of each elementary function, by recurrences, and says what a step takes from
those of the solution; `method` is the solver.

One more elementary function is added to `solvers.formulas`, with a rule in `terms`.
"""
