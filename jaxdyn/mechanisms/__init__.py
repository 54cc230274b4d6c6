"""Machines made of the laws in `formulations`: bars, sticks, rods, linkages, wires, cylinders.

May import: `geometry`, `formulations`.

One more machine is one file with a `Mechanism` (coordinates, points, ties), which then runs in
every formulation, or with a `System` of its own where no formulation fits. A ready-made scene of
it goes to `scenes`.
"""

from jaxdyn.mechanisms import bars as bars
from jaxdyn.mechanisms import cylinders as cylinders
from jaxdyn.mechanisms import euler_body as euler_body
from jaxdyn.mechanisms import four_bar as four_bar
from jaxdyn.mechanisms import guided as guided
from jaxdyn.mechanisms import rods as rods
from jaxdyn.mechanisms import sticks as sticks
