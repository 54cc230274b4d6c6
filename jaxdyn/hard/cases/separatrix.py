"""Starts on a separatrix, between swinging and rotating, where errors grow like exp(w t).

The closed forms are those of a pendulum that approaches upright, sin(theta / 2) = tanh(w t); of a
body whose spin approaches its middle axis, with angular velocities that are sech and tanh (Landau,
Lifshitz, Mechanics, section 37); and of the time in which a pendulum falls from almost upright, a
complete elliptic integral.
"""

import math

import numpy as np

from jaxdyn.analysis import energy
from jaxdyn.hard.case import Case, Figure
from jaxdyn.hard.elliptic import complete
from jaxdyn.integrate.events import Reaches, until
from jaxdyn.integrate.simulation import simulate
from jaxdyn.scenes.bodies import free_body
from jaxdyn.scenes.pendula import pendulum

_RTOL = 1e-15
_GROWN = 12.0  # exponent of the growth of errors until the end
_BESIDE = 1e-8  # angle from upright [rad]
_PI_LESS_DOUBLE = 1.2246467991473532e-16  # pi minus the nearest double
_CONSERVED = 1e-12


def _upright() -> tuple[Figure, ...]:
    motion = simulate(pendulum(g=1.0, angle=0.0, rate=2.0), _GROWN, samples=101, rtol=_RTOL)
    ts = np.asarray(motion.ts)
    wanted = np.stack([2 * np.arcsin(np.tanh(ts)), 2 / np.cosh(ts)], axis=1)
    errors = np.abs(np.asarray(motion.ys) - wanted).max(axis=1)
    return (
        Figure("angle and rate, as errors grow", float((errors * np.exp(-ts)).max()), 1e-14),
        Figure("angle and rate at the end", float(errors[-1]), 1e-9),
        Figure("energy", float(energy.drift(motion)), _CONSERVED),
    )


def _falls() -> tuple[Figure, ...]:
    scene = pendulum(g=1.0, angle=math.pi - _BESIDE)
    beside = math.pi - float(scene.y0[0]) + _PI_LESS_DOUBLE
    wanted = complete(math.sin(beside / 2))  # a quarter of the period, w = 1
    found = until(scene, Reaches(0, 0.0, -1), 2 * wanted, rtol=_RTOL)
    swing = simulate(scene, 4 * wanted, samples=401, rtol=_RTOL)
    return (
        Figure("time to the lowest place", abs(float(found.t) / wanted - 1), 1e-8),
        Figure("energy over the period", float(energy.drift(swing)), _CONSERVED),
        Figure("period [s]", 4 * wanted),
    )


def _middle_axis() -> tuple[Figure, ...]:
    """The figures of a body that approaches the spin about its middle axis.

    Moments 3, 4, 6 put the start (2, 0, 1) on the separatrix exactly: 3 * 2^2 = 12 * 1^2. Then
    omega = (2 sech, 3 n tanh, sech) of n t, n^2 = 1/2.
    """
    n = math.sqrt(0.5)
    scene = free_body((2.0, 0.0, 1.0), moments=(3.0, 4.0, 6.0))
    motion = simulate(scene, _GROWN / n, samples=101, rtol=_RTOL)
    ts = n * np.asarray(motion.ts)
    sech = 1 / np.cosh(ts)
    wanted = np.stack([2 * sech, 3 * n * np.tanh(ts), sech], axis=1)
    errors = np.abs(np.asarray(motion.ys)[:, -3:] - wanted).max(axis=1)
    momentum = np.asarray(energy.along(energy.angular_momentum, motion))
    turned = np.abs(momentum - momentum[0]).max() / np.linalg.norm(momentum[0])
    return (
        Figure("angular velocity, as errors grow", float((errors * np.exp(-ts)).max()), 1e-14),
        Figure("angular velocity at the end", float(errors[-1]), 1e-9),
        Figure("energy", float(energy.drift(motion)), _CONSERVED),
        Figure("angular momentum", float(turned), _CONSERVED),
    )


CASES = (
    Case(
        "separatrix-pendulum",
        "A pendulum with exactly the energy of upright approaches it.",
        _upright,
    ),
    Case(
        "fall-from-upright", "A pendulum falls from 1e-8 beside upright in the exact time.", _falls
    ),
    Case("separatrix-body", "The spin of a body approaches the unstable axis.", _middle_axis),
)
