"""Equilibria of a scene: the search for them, and the proof that there are no others.

`search` finds them by Levenberg-Marquardt iterations from many starts, `completeness` encloses
zeros in boxes by interval arithmetic, and says whether all of them were found, or why that is
unknown; `proving` proves it in ball arithmetic, with `proof` as the result.
`jaxdyn.analysis.equilibria` is the function that users call.
"""
