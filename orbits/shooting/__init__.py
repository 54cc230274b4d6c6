"""How the closing equations are solved: Newton's method, segments, logarithmic time.

`finding` has `orbits.find`, which looks for an orbit by a `strategy`: `multiple` by Newton's method
in segments, also from starts that need only another period, `descent` from a rough guess,
`deflation` away from known orbits, the folder `collocation` on a mesh, `automatic` by one strategy
and then another. `equations` has the residual and its Jacobian for the segments that `segment`
integrates;
`newton` is Newton's method and `outcomes` says how it ended; `segmentation` decides on the number
and the places of segments; `effort` has the tolerances and step limits of the search; `units` makes
the equations dimensionless; `trivial` finds the directions with multipliers of 1.

May import: `orbits`, that is the files at the top level.

To add an unknown of the equations, write a field of `Unknowns` in `equations`; to add a way to look
for an orbit, a subclass of `Strategy` in a file of its own.
"""
