"""How the closing equations are solved: Newton's method, segments, logarithmic time.

`finding` has `orbits.find`. It searches for an orbit by a `strategy` with tolerances and limits:
`multiple` (multiple shooting, and the default strategy), `descent` from a rough guess, `deflation`
away from known orbits, or `collocation` on a mesh.

`equations` has the residual of the closing equations and its Jacobian, in dimensionless form. Each
segment is integrated by `segment`, or crossed in one implicit step by `gauss_steps`. `newton` is
Newton's method, and `outcomes` says how it ended. `segmentation` decides how many segments there
are, and where they begin; `trivial` finds the directions whose multipliers are 1.

May import: `orbits`, that is the files at the top level.

To add an unknown of the equations, write a field of `Unknowns` in `equations`; to add a strategy, a
subclass of `Strategy` in a file of its own.
"""
