"""Linear vibrations of any scene about an equilibrium, and forced scenes.

`natural` has natural frequencies, damping ratios and mode shapes, with M, C and K; `transfer` the
transfer functions from an input to an output and the frequency response functions of engineering:
receptance, mobility, accelerance, transmissibility. `inputs` has the inputs of a scene (a force, a
moving base, a parameter) and the measured quantities, `signals` the dependence on time (a sine, a
step, a pulse, a sweep, an imbalance, a table); `forcing` makes a scene with an input, for all
functions that take a scene. `orbits.frequency_response` has the nonlinear responses of such a scene
over frequency.

May import: `analysis`, `effects`.

To add an input, write a subclass of `Input` in `inputs`; to add a signal, one of `Signal` in
`signals`; and add a line below.
"""

import jaxdyn._doors
from jaxdyn.vibration.forcing import drive, strike
from jaxdyn.vibration.inputs import Base, Force, Input, Motion, Parameter
from jaxdyn.vibration.natural import NaturalModes, modes
from jaxdyn.vibration.signals import Harmonic, Imbalance, Pulse, Signal, Step, Sweep, Table
from jaxdyn.vibration.transfer import (
    TransferFunction,
    accelerance,
    mobility,
    receptance,
    transfer_function,
    transmissibility,
)

__all__ = [
    "Base",
    "Force",
    "Harmonic",
    "Imbalance",
    "Input",
    "Motion",
    "NaturalModes",
    "Parameter",
    "Pulse",
    "Signal",
    "Step",
    "Sweep",
    "Table",
    "TransferFunction",
    "accelerance",
    "drive",
    "mobility",
    "modes",
    "receptance",
    "strike",
    "transfer_function",
    "transmissibility",
]

#: Renamed in version 0.3.
_RENAMED = {"driven": "drive", "struck": "strike"}
__getattr__ = jaxdyn._doors.attribute_getter(__name__, renamed=_RENAMED)
