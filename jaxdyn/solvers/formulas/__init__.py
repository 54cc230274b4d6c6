"""A rate as scalar formulas: what a vector field calculates, number by number, in normal form.

`graph` has the nodes, `formulas` runs through a rate's program with a node in place of each number,
`values` evaluates them; `simplified` has the formulas with the fewest products, in an order for
computation, and evaluates a rate by them. Functions that are composed of others, for arithmetic
with more digits, are in `formulas` as well.

To add a function with a Taylor series, write a row of `FUNCTIONS` in `graph`, a value in `values`
and a recurrence; to add a function that is only evaluated, a name in `ROUGH`.
"""
