"""Linear vibrations of any scene about an equilibrium, and what drives a scene.

`natural` has natural frequencies, damping ratios and mode shapes, with M, C and K; `transfer` the
transfer functions from an input to an output and the frequency response functions that engineers
name: receptance, mobility, accelerance, transmissibility. `inputs` says where something acts on a
scene (a force, a moving base, a parameter), `signals` how it changes in time (a sine, a step, a
pulse, a sweep, a table), `outputs` what is looked at; `driven` makes a scene with an input, for
everything that takes a scene. The nonlinear responses of such a scene over frequency are
`orbits.frequency_response`.

May import: `analysis`, `effects`.

One more input is a subclass of `Input` in `inputs`, one more signal one of `Signal` in `signals`,
and a line below.
"""

from jaxdyn.vibration.driven import driven, struck
from jaxdyn.vibration.inputs import Base, Force, Input, Motion, Parameter
from jaxdyn.vibration.natural import NaturalModes, modes
from jaxdyn.vibration.signals import Harmonic, Pulse, Signal, Step, Sweep, Table
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
    "driven",
    "mobility",
    "modes",
    "receptance",
    "struck",
    "transfer_function",
    "transmissibility",
]
