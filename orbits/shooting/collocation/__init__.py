"""Gauss collocation on an adaptive mesh, for orbits that are stiff or very unstable.

`steps` has the implicit step over an interval and its derivatives, `mesh` decides on the intervals,
`elimination` solves the linear equations of a Newton step, `newton` is the iteration and `search`
alternates it with new meshes.

May import: the files beside this folder.
"""
