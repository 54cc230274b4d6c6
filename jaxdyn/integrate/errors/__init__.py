"""How large the error of a solution is, for anything that can be run at a tolerance.

`estimate` is what is found, with the digits it leaves; `error_estimate` compares several runs, with
the rounding measured by `rounding_error`.
"""
