"""Solvers: the values of the argument ``solver`` of `simulate`.

- `Pair`: explicit, with a tolerance; the default for long rates. `NYSTROM12`, `VERNER9`, `DOPRI8`.
  With a step instead, for comparison: `EULER`, and the classic `RK4`.
- `Composition`: symplectic and explicit, with a step; for long conservative runs without forces
  that depend on velocity. `VERLET`, `BLANES_MOAN6`, `KAHAN_LI8`, `SOFRONIOU_SPALETTA10`.
- `Gauss`: symplectic and implicit, with a step; for long conservative runs of other scenes.
  `GAUSS8`, `GAUSS12`.
- `Stoermer`: explicit, with a tolerance; for forces that do not depend on velocity, of 3 to 12
  bodies or made of powers and quotients, in 0.6 to 0.9 of the time of a pair for the same error.
  `STOERMER14`; `STOERMER18`, mostly their default.
- `Taylor`: explicit, with a tolerance; for scenes with short formulas, in a fifth to three quarters
  of the time of a pair for an error of 1e-12; mostly their default. `TAYLOR8`, `TAYLOR12`,
  `TAYLOR14`, `TAYLOR16`, `TAYLOR20`.
- `Radau`: L-stable and implicit, with a tolerance; for stiff scenes. `RADAU5`, `RADAU9`.
- A Runge-Kutta solver of diffrax, such as ``diffrax.Tsit5()`` or the implicit
  ``diffrax.Kvaerno5()``; see `from_diffrax`.

`choice` selects the one for a scene. The folder contains `method` (the interface), `stepper` (one
step as diffrax calls it, with compensated sums, the loop over steps, and the sizes in which a
tolerance is absolute by default), `pairs` (with corrections of rounded tables),
`compositions`, `gauss`, `radau`, `stoermer`, the folder `taylor`, and `exchange` (with diffrax);
`side_by_side` steps several motions at once, `perturbed` magnifies rounding errors.
`enclosures` bounds the values of formulas over boxes in doubles (`jaxdyn.intervals`), for
equilibria; proofs of orbits use `ball_arithmetic`.

May import: `jaxdyn`, that is the files at the top level.

To add a solver, write a subclass of `Method` in a file of its own, and export the class and its
instances in ``__init__.pyi``; `jaxdyn run --solver` then accepts them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
