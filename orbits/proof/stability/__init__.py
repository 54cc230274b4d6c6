"""Enclosures of a proved orbit's multipliers, and what they prove about its stability.

`structure` proves what the flow keeps, symplectic forms among it, and says which multipliers that
prescribes. `multipliers` encloses the other multipliers of a matrix in balls,
`spectrum` those of an orbit, with the verdict.
"""
