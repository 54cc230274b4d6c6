"""How the closing equations are solved: Newton's method, segments, logarithmic time.

`finding` has `orbits.find`, which looks for an orbit by a `strategy`, with tolerances and limits:
`multiple` by Newton's method in segments, also from starts that need only another period, and by
default then by another strategy, `descent` from a rough guess, `deflation` away from known orbits,
`collocation` on a mesh. `equations` has the residual and its Jacobian for the segments that
`segment` integrates or `gauss_steps` crosses in one implicit step each, dimensionless; `newton` is
Newton's method and `outcomes` says how it ended; `segmentation` decides on the number and the
places of segments; `trivial` finds the directions with multipliers of 1.

May import: `orbits`, that is the files at the top level.

To add an unknown of the equations, write a field of `Unknowns` in `equations`; to add a way to look
for an orbit, a subclass of `Strategy` in a file of its own.
"""
