"""Stable and unstable manifolds of periodic orbits and rest points.

`manifold` follows strands from an orbit, `directions` has the tangents in which they begin,
`step_off` chooses how far from it, `strands` is the result.

May import: `families`.

One more kind of object that has manifolds is one more function in `directions`.
"""
