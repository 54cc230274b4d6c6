"""The error of the energy over a million periods.

With symplectic methods of fixed step it is bounded: no larger in the second half of the run than in
the first. With adaptive methods it grows; if their steps are accurate to rounding and the rounding
errors are random, it grows like the square root of time (Brouwer, 1937, Astron. J. 46, 149).
"""

import functools
import math
from collections.abc import Callable

import numpy as np

from jaxdyn.analysis import energy
from jaxdyn.hard.case import Case, Figure
from jaxdyn.hard.elliptic import complete
from jaxdyn.integrate.simulation import simulate
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.scenes.central import power_law
from jaxdyn.scenes.nbody import EIGHT_PERIOD, three_body
from jaxdyn.scenes.pendula import pendulum
from jaxdyn.solvers import GAUSS12, KAHAN_LI8, Method

_PERIODS = 1_000_000
_SAMPLES = 2000
_GOLDEN = (math.sqrt(5) - 1) / 2
_ORBITS, _TURNS = 24, 20_000
_ECCENTRICITY = 0.3


def kepler(eccentricity: float) -> Scene:
    """An orbit of semi-axis 1 and period 2 pi, from its far point."""
    e = eccentricity
    return power_law(k=1.0, n=-2.0, r=1 + e, speed=math.sqrt((1 - e) / (1 + e)))


def swinging_pendulum() -> Scene:
    """A pendulum with an amplitude of 1 rad and w = 1."""
    return pendulum(g=1.0, angle=1.0)


def energy_errors(motion: Trajectory) -> np.ndarray:
    """(s,) the errors of the energy at the samples, relative to its value at the start."""
    found = np.asarray(energy.along(energy.energy, motion))
    return np.abs(found / found[0] - 1)


def _figures(
    make: Callable[[], Scene], period: float, solver: Method, steps: float
) -> tuple[Figure, ...]:
    span, dt = _PERIODS * period, period / steps
    # The samples are spread over all phases, since at whole periods the error of a symplectic
    # method nearly vanishes.
    ts = span * (np.arange(_SAMPLES) + 0.5) / _SAMPLES + period * (
        np.arange(_SAMPLES) * _GOLDEN % 1
    )
    ts = np.concatenate([[0.0], ts[:-1]])
    most = int(2 * steps * _PERIODS)
    motion = simulate(make(), span, samples=ts, solver=solver, dt=dt, max_steps=most)
    errors = energy_errors(motion)
    early, late = errors[: _SAMPLES // 2].max(), errors[_SAMPLES // 2 :].max()
    # Below 1e-12 both are rounding errors without meaning.
    return (
        Figure("energy error, second half over first", float(late / max(early, 1e-12)), 1.5),
        Figure("energy error", float(errors.max()), 1e-6),
        Figure("steps", int(motion.steps)),
        Figure("steps a period", steps),
    )


def _grows() -> tuple[Figure, ...]:
    ts = np.concatenate([[0.0], np.geomspace(10 * math.tau, _TURNS * math.tau, 60)])
    squares, steps = np.zeros(len(ts)), 0
    for eccentricity in np.linspace(0.1, 0.5, _ORBITS):
        motion = simulate(kepler(eccentricity), ts[-1], samples=ts, rtol=1e-15, max_steps=10**8)
        squares += energy_errors(motion) ** 2
        steps += int(motion.steps)
    rms = np.sqrt(squares / _ORBITS)
    walked = rms[-1] / np.finfo(float).eps / math.sqrt(steps / _ORBITS)
    power = float(np.polyfit(np.log(ts[1:]), np.log(rms[1:]), 1)[0])
    return (
        Figure("power of time with which the error grows", power, 0.7),
        Figure("root mean square error of the energy at the end", float(rms[-1]), 1e-12),
        Figure("in spacings of doubles times the root of the steps", float(walked), 3.0),
        Figure("steps a period", steps / _ORBITS / _TURNS),
    )


# Steps per period; whole numbers would be in resonance with the motion.
_ORBIT = functools.partial(kepler, _ECCENTRICITY)
CASES = (
    Case(
        "million-periods-kepler",
        "The energy of a Kepler orbit has a bounded error over a million periods.",
        functools.partial(_figures, _ORBIT, math.tau, KAHAN_LI8, 25.3),
    ),
    Case(
        "million-periods-pendulum",
        "The energy of a pendulum has a bounded error over a million periods.",
        functools.partial(_figures, swinging_pendulum, 4 * complete(math.cos(0.5)), GAUSS12, 6.3),
    ),
    Case(
        "million-periods-eight",
        "The energy of the figure eight has a bounded error over a million periods.",
        functools.partial(_figures, three_body, EIGHT_PERIOD, KAHAN_LI8, 25.3),
    ),
    Case(
        "square-root-growth",
        "With adaptive steps the energy error grows no faster than the square root of time.",
        _grows,
    ),
)
