"""Springs as stiff as rods: two pushed masses on a line, with a known centre of mass.

Explicit methods resolve every vibration, and the number of vibrations grows like sqrt(k). A rod has
none. An L-stable method damps those below its tolerance, and then costs the same for any k.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn._checks import check_first
from jaxdyn.analysis.linearize import linearize
from jaxdyn.analysis.momenta import centre_of_mass
from jaxdyn.effects import SinusoidalForce, Spring
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.hard.case import Case, Figure
from jaxdyn.integrate.simulation import simulate
from jaxdyn.scene import Scene, check_scene
from jaxdyn.scenes.linkages import rod_on_line
from jaxdyn.solvers import RADAU9, Method

_MASSES, LENGTH, _FORCE, _FREQUENCY = (1.0, 2.0), 1.0, 1.0, 1.0
_MAX_VIBRATIONS = 1e3  # periods in the span beyond which a vibration is too fast to be resolved
_STIFFNESSES = (1e4, 1e6, 1e8, 1e10, 1e12)
_FOLLOWED = (1e4, 1e6)
_RTOL = 1e-8
_T1 = 20.0
_BOUND = 1e-9


def mass_centre(t):
    """(...) position of the centre of mass [m] at times t (...) [s], in closed form."""
    total = sum(_MASSES)
    swing = _FORCE / (total * _FREQUENCY**2)
    start = _MASSES[1] * LENGTH / total
    return start + swing * (_FREQUENCY * t - np.sin(_FREQUENCY * t))


def joined_by_rod(drift: str = "projection", *, t1=20.0) -> Scene:
    """The two masses on a rod, one of them pushed; see `rod_on_line` for `drift`."""
    push = {"force": _FORCE, "frequency": _FREQUENCY}
    return rod_on_line(m=_MASSES, length=LENGTH, drift=drift, t1=t1, **push)


def joined_by_spring(k, *, t1=20.0) -> Scene:
    """The two masses on a spring of stiffness k [N/m], one of them pushed."""
    push = SinusoidalForce([_FORCE], _FREQUENCY, on=(1,))
    y0 = [0.0, LENGTH, 0.0, 0.0]
    system = FreePoints(jnp.asarray(_MASSES), 1)
    return Scene(system, (Spring(k, LENGTH, i=0, j=1), push), y0=y0, t1=t1)


@check_first
def advice(scene: Scene, t1=None) -> str:
    """Advice on what to use instead of links too stiff to be resolved, or ""; host only.

    The largest eigenvalue at the start gives the fastest vibration. An explicit method has to
    resolve every period of it, even if the vibration does not matter.

    Args:
      scene: system, effects and start.
      t1: () end of the span [s]; that of the scene by default.
    Example:
      >>> advice(joined_by_spring(1e12))[:67]
      'The stiffest link vibrates at 1.22e+06 rad/s, 3.9e+06 times in the '
    """
    fastest = float(np.abs(np.asarray(linearize(check_scene(scene), scene.y0).eigenvalues)).max())
    turns = fastest * abs(float(scene.t1 if t1 is None else t1)) / (2 * np.pi)
    if turns < _MAX_VIBRATIONS:
        return ""
    return (
        f"The stiffest link vibrates at {fastest:.3g} rad/s, {turns:.2g} times in the span, and "
        "the default method follows each. Where it stands for a rod, take the rod (scenes with "
        "formulation='constrained'): it costs least, whatever the stiffness. Where it must stay, "
        "pass solver=solvers.RADAU9 and rtol=1e-8: it leaves out vibrations too small to matter."
    )


def _spring() -> tuple[Figure, ...]:
    rod = _ran(joined_by_rod(), rtol=1e-10)
    springs = [_ran(joined_by_spring(k), rtol=_RTOL, solver=RADAU9) for k in _STIFFNESSES]
    followed = [_ran(joined_by_spring(k), rtol=1e-10) for k in _FOLLOWED]
    warned = [advice(joined_by_spring(k), _T1) for k in _STIFFNESSES]
    steps = [spring[1] for spring in springs]
    return (
        Figure("mass centre of the rod [m]", rod[0], _BOUND),
        Figure("of all springs by Radau [m]", max(spring[0] for spring in springs), _BOUND),
        Figure("of those followed [m]", max(spring[0] for spring in followed), _BOUND),
        Figure("steps at k = 1e12, over 1e8", steps[-1] / steps[2], 1.1),
        *(Figure(f"steps at k = {k:g}", n) for k, n in zip(_STIFFNESSES, steps, strict=True)),
        *(
            Figure(f"steps followed, k = {k:g}", spring[1])
            for k, spring in zip(_FOLLOWED, followed, strict=True)
        ),
        Figure("steps of the rod", rod[1]),
        Figure("users not told, k = 1e6 on", sum(not words for words in warned[1:]), 0),
    )


def _ran(scene: Scene, *, rtol: float, solver: Method | None = None) -> tuple[float, int]:
    """The error of the centre of mass at the end [m], and the number of steps."""
    motion = simulate(scene, _T1, samples=1, rtol=rtol, solver=solver)
    found = centre_of_mass(_T1, scene.system.points(_T1, motion.ys[-1]))[0]
    return abs(float(found - mass_centre(_T1))), int(motion.steps + motion.rejected)


CASES = (
    Case(
        "stiff-spring",
        "Springs of k = 1e4 to 1e12 agree with the rod that they approximate.",
        _spring,
    ),
)
