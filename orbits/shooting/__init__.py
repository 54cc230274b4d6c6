"""How the closing equations are solved: Newton's method, segments, logarithmic time.

`finding` has `orbits.find`; `equations` has the residual and its Jacobian, of the segments that
`pieces` integrates; `descent` leads a rough guess to where Newton's method converges; `newton` is
the method and `outcomes` says how it ended; `cuts` divides a
period into segments; `retimed` handles starts that need only another period; `trivial` finds the
directions in which multipliers must be 1.

May import: `orbits`, that is the files beside the folders.

One more unknown of the equations is a field of `Unknowns` in `equations`; one more method of
solution is a file beside `newton`, called from `finding`.
"""
