"""Problem 21: two pushed masses, joined by a rod or by a stiff spring: which is faster to compute?

The rod needs differential-algebraic equations. The spring does not, but its vibration has to be
resolved, with steps proportional to 1 / sqrt(k). The centre of mass moves in the same way with
both, x_G'' = F sin(w t) / (m1 + m2), and its closed form measures the errors.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn._records.kinds import check_first
from jaxdyn.accuracy.quantities import Quantity
from jaxdyn.accuracy.work_precision import work_precision
from jaxdyn.analysis.linearize import linearize
from jaxdyn.analysis.momenta import centre_of_mass
from jaxdyn.effects import SinusoidalForce, Spring
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.simulation import simulate, solve
from jaxdyn.scene import Scene, check_scene
from jaxdyn.scenes.linkages import rod_on_line
from jaxdyn.solvers import default_solver

_MASSES, _LENGTH, _FORCE, _FREQUENCY = (1.0, 2.0), 1.0, 1.0, 1.0
_SAMPLES = 201
_MAX_VIBRATIONS = 1e3  # periods of a vibration beyond which it counts as too fast to be resolved


class Row(NamedTuple):
    """The cost of a given accuracy of the centre of mass, for one way to join the masses.

    Attributes:
      name: rod or spring.
      rtol: the loosest tolerance that reaches the accuracy; NaN if there is none.
      error: of the centre of mass at the end [m].
      stretch: largest change of the distance between the masses at that tolerance [m].
      seconds: median time of a run.
      evaluations: of the right-hand side.
    """

    name: str
    rtol: float
    error: float
    stretch: float
    seconds: float
    evaluations: float


def compare(k=(1e2, 1e4, 1e6), *, t1=20.0, digits=9, rounds=10) -> tuple[Row, ...]:
    """Compare the rod, for each `drift`, and springs, at equal accuracy of the centre of mass.

    The rod is faster than any spring stiff enough to replace it: a spring that is ten times stiffer
    takes three times as long, and still stretches. The centre of mass is not less accurate with a
    spring: its two forces cancel in the sum, and the short steps make the centre of mass accurate
    to rounding, which the rod reaches at a tighter tolerance for less time. On a line the
    constraint is linear and does not drift even without correction ("raw"); Baumgarte's method
    perturbs it.

    Args:
      k: stiffnesses of the springs [N/m].
      t1: span [s].
      digits: correct decimal places of the centre of mass [m] at the end.
      rounds: how often each run is timed.
    Returns:
      A row for each drift of `scenes.rod_on_line`, then one for each spring.
    """
    drifts = ("projection", "baumgarte", "raw")
    joined = {f"rod, {drift}": joined_by_rod(drift, t1=t1) for drift in drifts}
    joined |= {f"spring, k = {stiffness:g}": joined_by_spring(stiffness, t1=t1) for stiffness in k}
    return tuple(_row(name, scene, t1, digits, rounds) for name, scene in joined.items())


def mass_centre(t):
    """(...) position of the centre of mass [m] at times t (...) [s], in closed form."""
    total = sum(_MASSES)
    swing = _FORCE / (total * _FREQUENCY**2)
    start = _MASSES[1] * _LENGTH / total
    return start + swing * (_FREQUENCY * t - np.sin(_FREQUENCY * t))


def joined_by_rod(drift: str = "projection", *, t1=20.0) -> Scene:
    """The two masses on a rod, one of them pushed; see `compare` for `drift`."""
    push = {"force": _FORCE, "frequency": _FREQUENCY}
    return rod_on_line(m=_MASSES, length=_LENGTH, drift=drift, t1=t1, **push)


def joined_by_spring(k, *, t1=20.0) -> Scene:
    """The two masses on a spring of stiffness k [N/m], one of them pushed."""
    push = SinusoidalForce([_FORCE], _FREQUENCY, on=(1,))
    y0 = [0.0, _LENGTH, 0.0, 0.0]
    system = FreePoints(jnp.asarray(_MASSES), 1)
    return Scene(system, (Spring(k, _LENGTH, i=0, j=1), push), y0=y0, t1=t1)


@check_first
def advice(scene: Scene, t1=None) -> str:
    """What to use instead of links that are too stiff to be resolved, or ""; host only.

    The largest eigenvalue at the start gives the fastest vibration. An explicit method has to
    resolve every period of it, even if the vibration does not matter.

    Args:
      scene: system, effects, start.
      t1: () end of the span [s]; the scene's own if left out.
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


def _row(name: str, scene: Scene, t1, digits, rounds) -> Row:
    def centre(scene, t1, *, solver, rtol, dt):
        y1 = solve(scene, t1, solver=solver, rtol=rtol, dt=dt).y1
        return centre_of_mass(t1, scene.system.points(t1, y1))[0]

    wanted = Quantity("mass centre", centre, float(mass_centre(t1)))
    # A pair: the evaluations of a series cannot be counted.
    solver = default_solver(scene, several=True)
    found = work_precision(scene, t1, solvers=[solver], quantity=wanted, rounds=rounds)
    choice = found.recommend(digits)
    if choice is None:
        return Row(name, *[float("nan")] * 5)
    (rung,) = (r for r in found.curves[0].rungs if r.fineness == choice.fineness)
    motion = simulate(scene, t1, samples=_SAMPLES, rtol=choice.fineness, solver=solver)
    r = jax.vmap(lambda t, y: scene.system.points(t, y).r)(motion.ts, motion.ys)
    stretch = float(jnp.max(jnp.abs(r[:, 1, 0] - r[:, 0, 0] - _LENGTH)))
    return Row(
        name=name,
        rtol=choice.fineness,
        error=choice.error,
        stretch=stretch,
        seconds=choice.seconds,
        evaluations=rung.evaluations,
    )
