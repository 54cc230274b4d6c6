"""How regular or chaotic the motions of a scene are.

`lyapunov` computes the Lyapunov exponents of one motion, with error bars, by a frame of tangents
that is carried along it. `indicators` has MEGNO, SALI and GALI for many starts at once; `maps`
computes them over two numbers. `frequencies` resolves a motion into its frequencies. `timed` has
the results that print times and rates in the unit of a scene.

May import: `ensemble`, `analysis`, `files`.

To add a measure of chaos, write a file with a function of a `Scene` that returns a `Record`, and a
line below.
"""

from jaxdyn.chaos.frequencies import Frequencies, frequencies
from jaxdyn.chaos.indicators import Alignment, Megno, gali, megno, sali
from jaxdyn.chaos.lyapunov import LyapunovSpectrum, lyapunov_exponents
from jaxdyn.chaos.maps import ChaosMap, chaos_map

__all__ = [
    "Alignment",
    "ChaosMap",
    "Frequencies",
    "LyapunovSpectrum",
    "Megno",
    "chaos_map",
    "frequencies",
    "gali",
    "lyapunov_exponents",
    "megno",
    "sali",
]
