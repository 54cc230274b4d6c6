"""From a start to samples: solving, step control, derivatives, events, phases.

`simulation` has `jaxdyn.simulate` and `jaxdyn.solve`, `trajectory` has what they return,
`errors` says how accurate that is, `spans` checks their arguments. `flow` is the compiled solve
with its derivatives in both modes, by the variational equations, and the change to another method
where the default does not suit a motion. `adjoint` has the gradient of one loss with respect to
many numbers (`adjoint=True`), `fixed` the solve with the parameters as constants. `march` is the
loop over steps: their size, samples on the way, and how none passes over brief parts of a rate.
`pieces` follows rates with conditions, each piece in one branch; `resting` treats events whose
values stay at zero while such a motion is held on a surface. Events are in `events` (the calls,
and what they return) and in the folder `event_search` (the search within a step). Piecewise-smooth
motions are in `phases` (the calls, which phase is first and next) and `phase` (one phase, and when
a state fits it).

May import: `solvers`, `plan`. A scene is used only through its rate, its projection and its labels.

To add a kind of result, write a file beside `events` that uses `flow` or `event_search` and the
limits of `spans`; if users call it, add a line in ``__init__.pyi``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
