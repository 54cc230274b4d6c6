"""Questions about a scene or a motion: conserved quantities, equilibria, stability.

Along a motion there are `energy`, `momenta`, `work_by_effect`, `energy_change` (what changes it)
and `constraints` (tensions, reactions, rank); `regularized` and `approaches` follow close
encounters. At a state, `elements` has the Keplerian elements of an orbit, with mean anomalies in
`kepler`, and `free_body` all forces on each body. `static_friction` has rates and forces where
friction holds a body. Stability is the subject of `linearize`, `steady` (steady motions),
`floquet` (driven scenes) and `precession`; `eigenvalues` decides it (for orbits, from the
`monodromy` matrix), at centres `energy_extremum`.
`equilibria` finds equilibria; the folder `equilibrium_search` searches for them and proves that
there are no others. `scales_at_rest` has the scales of the entries and of time near an equilibrium;
`_roots` finds zeros of functions of one variable, each in its bracket.

May import: `integrate`, `formulations`, `ball_arithmetic`.

To add an analysis, write a file with a function of a `Scene` or a `Trajectory`, and a line in
``__init__.pyi``.
"""

import lazy_loader

import jaxdyn._doors

_listed, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

__getattr__ = jaxdyn._doors.attribute_getter(
    __name__, _listed, modules={"regularised": "jaxdyn.analysis.regularized"}
)
