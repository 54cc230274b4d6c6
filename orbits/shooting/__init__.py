"""How the closing equations are solved: Newton's method, segments, logarithmic time.

`finding` has `orbits.find`; `equations` has the residual and its Jacobian, of the segments that
`segment` integrates; `descent` improves a rough guess until Newton's method converges; `newton` is
that method, `deflation` leads it away from known orbits and `outcomes` says how it ended;
`segmentation` decides on the number and the places of segments, `recutting` on more of them; the
folder `collocation` solves them by steps on a mesh instead of integrations, for stiff and very
unstable orbits; `effort` has the tolerances and step limits of the search; `retimed` handles starts
that need only another period; `units` makes the equations dimensionless; `trivial` finds the
directions with multipliers of 1.

May import: `orbits`, that is the files at the top level.

One more unknown of the equations is a field of `Unknowns` in `equations`; one more method of
solution is a file beside `newton`, called from `finding`.
"""
