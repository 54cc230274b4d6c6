"""Bodies that nearly collide: the Pythagorean problem, and orbits of high eccentricity.

The reference for the Pythagorean problem was computed with 48 digits by
tests/references/pythagorean_reference.py; a test compares it with that file. The orbits follow
Kepler's laws. Both are run in logarithmic time (`jaxdyn.analysis.regularized`) and, for comparison,
in plain time.
"""

import functools
import math
from fractions import Fraction

import numpy as np
from jaxtyping import Array

from jaxdyn.analysis import energy
from jaxdyn.analysis.approaches import closest_approaches
from jaxdyn.analysis.regularized import simulate_regularized
from jaxdyn.hard.case import Case, Figure, relative_error
from jaxdyn.integrate.simulation import simulate
from jaxdyn.scene import Scene
from jaxdyn.scenes.central import power_law
from jaxdyn.scenes.nbody import three_body

#: Outcome of the Pythagorean problem at t = 70: semi-major axis and eccentricity of the binary of
#: bodies 2 and 3, speed at infinity and direction of body 1 as seen from the binary.
PYTHAGOREAN_OUTCOME = (
    0.55249643916368876617,
    0.98869907600057511605,
    2.1670147736686492826,
    1.2460068987939137738,
)
#: Times and distances of the two closest approaches in it, both of bodies 2 and 3.
PYTHAGOREAN_APPROACHES = (
    (15.829920271580902646, 0.00041382483625870108346),
    (29.801522340863979954, 0.0027937193036127406317),
)
_RTOL = 1e-14
_PERIODS = 1000


def pythagorean() -> Scene:
    """Masses 3, 4, 5 at rest at the corners of a 3-4-5 triangle, over 70 units of time.

    After fifteen close encounters body 1 escapes and the other two form a binary.

    Reference: Szebehely, Peters (1967), Astron. J. 72, 876.
    """
    corners = (1.0, 3.0, -2.0, -1.0, 1.0, -1.0)
    return three_body((*corners, *[0.0] * 6), m=(3.0, 4.0, 5.0), t1=70.0)


def pythagorean_outcome(y: Array) -> np.ndarray:
    """(4,) the elements listed in `PYTHAGOREAN_OUTCOME`, for a state (12,) of the scene."""
    r, v = np.asarray(y).reshape(2, 3, 2)
    weight = np.array([4.0, 5.0]) / 9
    inner, axis_energy = (r[2] - r[1], v[2] - v[1]), 9.0
    outer = (r[0] - weight @ r[1:], v[0] - weight @ v[1:])
    own = inner[1] @ inner[1] / 2 - axis_energy / np.hypot(*inner[0])
    turning = inner[0][0] * inner[1][1] - inner[0][1] * inner[1][0]
    left = outer[1] @ outer[1] / 2 - 12.0 / np.hypot(*outer[0])
    eccentricity = math.sqrt(1 + 2 * own * (turning / 9.0) ** 2)
    angle = math.atan2(outer[1][1], outer[1][0])
    return np.array([-4.5 / own, eccentricity, math.sqrt(2 * left), angle])


def _pythagorean() -> tuple[Figure, ...]:
    scene = pythagorean()
    motion = simulate_regularized(scene, rtol=_RTOL)
    plain = simulate(scene, rtol=_RTOL, samples=2)
    nearest = closest_approaches(scene, rtol=_RTOL)[:2]
    found = [x for near in nearest for x in (near.t, near.distance)]
    return (
        Figure("escape and binary", _error(motion.ys[-1]), 1e-6),
        Figure("energy error", float(energy.drift(motion)), 1e-10),
        Figure("closest approaches", relative_error(found, np.ravel(PYTHAGOREAN_APPROACHES)), 1e-6),
        Figure("nearest two bodies come [m]", nearest[0].distance),
        Figure("steps", int(motion.steps)),
        Figure("escape and binary in plain time", _error(plain.ys[-1])),
    )


def _error(y: Array) -> float:
    return relative_error(pythagorean_outcome(y), PYTHAGOREAN_OUTCOME)


def eccentric(gap: float) -> Scene:
    """An orbit of eccentricity 1 - gap and semi-axis 1 from its far point, about a sun of k = 1."""
    return power_law(k=1.0, n=-2.0, r=2.0 - gap, speed=math.sqrt(gap / (2.0 - gap)))


def _eccentric(gap: float) -> tuple[Figure, ...]:
    scene = eccentric(gap)
    r, v = (Fraction(float(x)) for x in (scene.y0[0], scene.y0[3]))
    size = float(2 / r - v * v)  # 1 / semi-axis of the rounded start
    period = 2 * math.pi * size**-1.5
    t1 = _PERIODS * period
    motion = simulate_regularized(scene, t1, samples=2, rtol=_RTOL)
    plain = simulate(scene, t1, samples=2, rtol=_RTOL, throw=False)
    late, turned = _off(motion.ys[-1], size)
    late_plain, turned_plain = _off(plain.ys[-1], size)
    return (
        Figure("error of the period", late / t1, 1e-11),
        Figure("apse turned [rad]", turned, 1e-9),
        Figure("steps a period", int(motion.steps) / _PERIODS),
        Figure("error of the period in plain time", late_plain / t1),
        Figure("apse turned in plain time [rad]", turned_plain),
        Figure("steps a period in plain time", int(plain.steps) / _PERIODS),
    )


def _off(y: Array, size: float) -> tuple[float, float]:
    """The time [s] by which a state near the far point is past it, and the apse's turn [rad]."""
    r, v = np.asarray(y[:2]), np.asarray(y[2:])
    distance = np.hypot(*r)
    # At the far point r . v = 0; from there it changes at the rate v^2 - 1 / r.
    late = (r @ v) / (1 / distance - size)
    turning = r[0] * v[1] - r[1] * v[0]
    apse = np.array([v[1], -v[0]]) * turning - r / distance
    return abs(float(late)), abs(math.atan2(-apse[1], -apse[0]))


CASES = (
    Case(
        "pythagorean",
        "Three bodies from rest go through all close encounters to escape, right to 6 digits.",
        _pythagorean,
    ),
    Case(
        "kepler-0.9",
        "An orbit of eccentricity 0.9 keeps its period and its apse for 1000 periods.",
        functools.partial(_eccentric, 0.1),
    ),
    Case(
        "kepler-0.99",
        "An orbit of eccentricity 0.99 keeps its period and its apse for 1000 periods.",
        functools.partial(_eccentric, 1e-2),
    ),
    Case(
        "kepler-0.999999",
        "An orbit of eccentricity 0.999999 keeps its period and its apse for 1000 periods.",
        functools.partial(_eccentric, 1e-6),
    ),
    Case(
        "near-radial-fall",
        "A body that falls past a sun at 5e-11 of its distance returns unchanged 1000 times.",
        functools.partial(_eccentric, 1e-10),
    ),
)
