"""How regular or chaotic the motions of a scene are.

`lyapunov` has the Lyapunov exponents of one motion with their error bars, computed with the frame
of tangents of `stretching`.

May import: `ensemble`, `analysis`.

One more measure of chaos is one file with a function of a `Scene` that returns a `Record`, and one
line below.
"""

from jaxdyn.chaos.lyapunov import LyapunovSpectrum, lyapunov_exponents

__all__ = ["LyapunovSpectrum", "lyapunov_exponents"]
