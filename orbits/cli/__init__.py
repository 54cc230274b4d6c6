"""The command line of `orbits`, one file per command or two.

`find`, `responses` (frequency responses and backbones), `aim`, `basins`, `loops`, `manifold`,
`search`, `section`, `figure_eight`, `show`, `verify` and `prove` (with `refine`) have the commands,
which `app` collects; those that change a parameter are in `bifurcations`. `shared` has their common
parts, `printed` the tables of claims and of families. Options that they share with the commands of
`jaxdyn` are in `jaxdyn/cli/shared.py`.

May import: `drawing`, `discovery`, `hybrid`. Nothing here loads JAX before a command needs it.

To add a command, write a function in a file of its own, and a call of `add` with an example in
`app`.
"""
