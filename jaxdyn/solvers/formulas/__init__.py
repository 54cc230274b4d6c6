"""A rate as scalar formulas: what a vector field calculates, number by number, in normal form.

`formulas` runs through a rate's program with a node of `graph` in place of each number (`on_numpy`
moves arrays of them), `ordered` sorts them for computation, `shortest` has the ones with the fewest
products, `values` evaluates them, `simplified` is a rate that is evaluated by them. `composed` has
functions made of others, for arithmetic with more digits.

One more elementary function is a row of `FUNCTIONS` in `graph` and a value in `values`.
"""
