"""A rate as scalar formulas: what a vector field calculates, number by number, in normal form.

`formulas` runs through a rate's program with a node of `graph` in place of each number
(`on_arrays` has operations on arrays of nodes, `on_numpy` those that only move them),
`topological_order` sorts nodes for computation, `shortest` has the ones with the fewest products,
`values` evaluates them, `simplified` is a rate that is evaluated by them. `composed` has functions
made of others, for arithmetic with more digits.

One more function with a Taylor series is a row of `FUNCTIONS` in `nodes`, a value in `values` and
a recurrence; one that is only evaluated a name in `ROUGH`.
"""
