"""How the closing equations are solved: Newton's method, segments, logarithmic time.

`finding` has `orbits.find`, `equations` the residual and its Jacobian, `newton` the method, `cuts`
divides a period into segments, `trivial` knows the directions in which multipliers must be 1,
`retimed` starts that need only a period.

May import: `orbits`, that is the files beside the folders.

One more unknown of the equations is a field of theirs in `equations`; one more method of solution
is a file beside `newton`.
"""
