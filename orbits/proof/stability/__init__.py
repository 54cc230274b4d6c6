"""Enclosures of a proved orbit's multipliers, and what they prove about its stability.

`structure` proves which integrals, symmetries and symplectic form the flow has, and which
multipliers these prescribe. `multipliers` encloses the other multipliers of a matrix in balls,
`spectrum` those of an orbit, with the verdict.
"""
