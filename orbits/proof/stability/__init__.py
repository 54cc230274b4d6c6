"""Enclosures of a proved orbit's multipliers, and what they prove about its stability.

`structure` proves what the flow keeps, and says which multipliers that prescribes; `forms` finds
candidates for symplectic forms. `multipliers` encloses the other multipliers of a matrix in balls,
`spectrum` those of an orbit, with the verdict.
"""
