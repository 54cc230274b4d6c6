"""Springs as stiff as rods: two pushed masses on a line, with a known centre of mass.

Explicit methods resolve every vibration, whose number grows like sqrt(k). A rod has none. An
L-stable method damps those below its tolerance, and then costs the same for any k.
"""

from jaxdyn.analysis.momenta import centre_of_mass
from jaxdyn.hard.case import Case, Figure
from jaxdyn.integrate.simulation import simulate
from jaxdyn.scene import Scene
from jaxdyn.solvers import RADAU9, Method
from jaxdyn.studies.rod_or_spring import advice, joined_by_rod, joined_by_spring, mass_centre

_STIFFNESSES = (1e4, 1e6, 1e8, 1e10, 1e12)
_FOLLOWED = (1e4, 1e6)
_RTOL = 1e-8
_T1 = 20.0
_BOUND = 1e-9


def _spring() -> tuple[Figure, ...]:
    rod = _ran(joined_by_rod(), rtol=1e-10)
    springs = [_ran(joined_by_spring(k), rtol=_RTOL, solver=RADAU9) for k in _STIFFNESSES]
    followed = [_ran(joined_by_spring(k), rtol=1e-10) for k in _FOLLOWED]
    told = [advice(joined_by_spring(k), _T1) for k in _STIFFNESSES]
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
        Figure("users not told, k = 1e6 on", sum(not words for words in told[1:]), 0),
    )


def _ran(scene: Scene, *, rtol: float, solver: Method | None = None) -> tuple[float, int]:
    """Error of the centre of mass at the end [m], and number of steps."""
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
