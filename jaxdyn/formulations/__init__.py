"""Laws of motion: how forces move coordinates, one file a formulation.

`newton` (free points), `polar` (one in polar coordinates), `newton_euler` and `lagrange` (free
coordinates), `constrained` (constraints and rolling conditions, by Lagrange multipliers;
`dependence` finds which of them are redundant), `rigid` (a body in space; `attitude` is its
orientation, a quaternion or a matrix), `prescribed` (a given motion).
`mechanism` has the parts that formulations of mechanisms share: coordinates and the points that
they place. `extended` is a system with further entries in its state. `choice` sets one mechanism up
in several formulations.

Equations of your own are `ode` (a rate; `jaxdyn.ode`) and the second half of `lagrange` (a
Lagrangian; `jaxdyn.lagrangian`). `functions` checks the functions that both are given, `structure`
is the pytree that a state may stand for. `xpp` reads equations that are written as text.

May import: `geometry`.

To add a formulation, write a `System` in a file of its own, and a line below; if every `Mechanism`
can be set up in it, a row of `_FREE` in `choice` offers it to all mechanisms.
"""

from jaxdyn.formulations import (
    attitude,
    choice,
    constrained,
    extended,
    functions,
    lagrange,
    mechanism,
    newton,
    newton_euler,
    ode,
    polar,
    prescribed,
    rigid,
    structure,
    xpp,
)

__all__ = [
    "attitude",
    "choice",
    "constrained",
    "extended",
    "functions",
    "lagrange",
    "mechanism",
    "newton",
    "newton_euler",
    "ode",
    "polar",
    "prescribed",
    "rigid",
    "structure",
    "xpp",
]
