"""Multipliers of a proved orbit, enclosed, and what they prove of its stability.

`structure` proves what the flow keeps, and says which multipliers that prescribes; `forms` finds
symplectic forms for it. `multipliers` has the others of a matrix in balls, `spectrum` those of an
orbit with the verdict.
"""
