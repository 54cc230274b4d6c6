"""A rate as scalar formulas: what a vector field calculates, number by number, in normal form.

`graph` has the nodes and their values; `formulas` runs through a rate's program with a node in
place of each number, finds the formulas with the fewest products, in an order for computation, and
evaluates a rate by them; `alternatives` has whole numbers within them, such as places in tables.
Functions that are composed of others, for arithmetic with more digits, are in `formulas` as well.

To add a function with a Taylor series, write a row of `FUNCTIONS` and one of `_VALUES` in `graph`,
and a recurrence; to add a function that is only evaluated, a name in `ROUGH`.
"""
