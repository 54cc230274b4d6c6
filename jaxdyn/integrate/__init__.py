"""From a start to samples: solving, step control, derivatives, events, phases.

`simulation` is the front door (`jaxdyn.simulate`, `jaxdyn.solve`), `trajectory` what it returns,
`flow` the compiled solve and its derivatives, `step_control` decides the step size, `crossings`
finds events within a step, `events` and `phases` are the public calls for them, `ladder`
estimates errors from several runs.

May import: `scene`, `solvers`. It sees a scene only as its rate, projection and labels.
"""

from jaxdyn.integrate import events as events
from jaxdyn.integrate import phases as phases
