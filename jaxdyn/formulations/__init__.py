"""Laws of motion: how forces move coordinates, one formulation in each file.

`newton` (free points), `polar` (one in polar coordinates), `newton_euler` and `lagrange` (free
coordinates), `constrained` (constraints and rolling conditions, by Lagrange multipliers;
`dependence` finds which of them are redundant), `rigid` (a body in space; `attitude` is its
orientation, a quaternion or a matrix), `linear` (constant matrices), `prescribed` (a given motion).
`mechanism` has the parts that formulations of mechanisms share: coordinates and the points that
they place. `extended` is a system with further entries in its state. `choice` sets one mechanism up
in several formulations.

Equations of your own are `ode` (a rate; `jaxdyn.ode`) and the second half of `lagrange` (a
Lagrangian; `jaxdyn.lagrangian`). `functions` checks the functions that both are given, `structure`
is the pytree that a state may stand for. `xpp` reads equations that are written as text, and
`xpp_expressions` the expressions in them.

May import: `geometry`.

To add a formulation, write a `System` in a file of its own, and a line in ``__init__.pyi``; if
every `Mechanism` can be set up in it, a row of `_FREE` in `choice` offers it to all mechanisms.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
