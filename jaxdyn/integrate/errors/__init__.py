"""How large the error of a solution is, for anything that can be run at a tolerance.

`estimate` is the record of what is found, with the digits it leaves; `error_estimate` compares
several runs, and `rounding_error` measures the rounding.
"""
