"""A rate as scalar formulas: what a vector field calculates, number by number, in normal form.

`graph` has the nodes and their values; `formulas` runs through a rate's program with a node in
place of each number, finds the formulas with the fewest products, in an order for computation, and
evaluates a rate by them. Functions that are composed of others, for arithmetic with more digits,
are in `formulas` as well.

One more function with a Taylor series is a row of `FUNCTIONS` and one of `_VALUES` in `graph`, and
a recurrence; a function that is only evaluated is a name in `ROUGH`.
"""
