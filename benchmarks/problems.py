"""The problems, each as a scene and as plain formulas for the other methods.

The formulas are written once, as functions of a library with sine, cosine and root (NumPy or
heyoka), and return the rate: from the numbers of a state to the list of their derivatives. For
heyoka the numbers are symbols, for SciPy floats in a function that numba compiles; diffrax uses
our scene.
"""

import math
from collections.abc import Callable, Sequence
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

import jaxdyn
from jaxdyn import scenes
from jaxdyn.effects import PairGravity, SpringNetwork
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Effect, Scene


class Problem(NamedTuple):
    """A problem to integrate.

    Attributes:
      scene: system, effects and span.
      formulas: library with `sin`, `cos` and `sqrt` -> rate.
      y0s: (n, k) starts; a run integrates each in turn over the span.
    """

    scene: Scene
    formulas: Callable
    y0s: np.ndarray

    @property
    def t1(self) -> float:
        """The span [s]."""
        return float(self.scene.t1)


def from_start(scene: Scene, formulas: Callable) -> Problem:
    """One run, from the start of a scene."""
    return Problem(scene, formulas, np.asarray(scene.y0)[None])


def gravity(m: Sequence[float], d: int = 2, g: float = 1.0) -> Callable:
    """Bodies of masses m in d dimensions that attract each other."""
    n = len(m)

    def formulas(lib):
        def rate(y):
            a = [0.0] * (d * n)
            for i in range(n):
                for j in range(i + 1, n):
                    apart = [y[d * j + c] - y[d * i + c] for c in range(d)]
                    r2 = apart[0] * apart[0]
                    for x in apart[1:]:  # a generator would not compile in numba
                        r2 = r2 + x * x
                    weight = g / (r2 * lib.sqrt(r2))
                    for c, x in enumerate(apart):
                        a[d * i + c] = a[d * i + c] + m[j] * weight * x
                        a[d * j + c] = a[d * j + c] - m[i] * weight * x
            return [y[d * n + i] for i in range(d * n)] + a

        return rate

    return formulas


def figure_eight() -> Problem:
    """One period of three bodies on the eight."""
    return from_start(scenes.three_body(), gravity((1.0, 1.0, 1.0)))


def kepler() -> Problem:
    """Ten turns of two equal bodies on ellipses of eccentricity 0.9, from their farthest points."""
    scene = two_bodies(0.9, turns=10)
    return from_start(scene, gravity((0.5, 0.5)))


def two_bodies(e: float, turns: float = 1.0) -> Scene:
    """Two bodies from their farthest points of ellipses of eccentricity e; one turn takes 2 pi."""
    r, v = 1 + e, math.sqrt((1 - e) / (1 + e))
    y0 = jnp.array([-r, 0.0, r, 0.0, 0.0, -v, 0.0, v]) / 2
    return Scene(FreePoints([0.5, 0.5]), (PairGravity(1.0),), y0=y0, t1=2 * math.pi * turns)


#: Nine points in rows of three, joined along rows, columns and both diagonals.
SPRINGS = tuple(
    (i, j)
    for i in range(9)
    for j in range(i + 1, 9)
    if abs(i // 3 - j // 3) <= 1 and abs(i % 3 - j % 3) <= 1
)
_LENGTHS = tuple(math.hypot(i // 3 - j // 3, i % 3 - j % 3) for i, j in SPRINGS)
_SHAKEN = 0.1  # [m] initial displacement of the sheet


def sheet() -> Problem:
    """Nine points joined by 20 springs to a sheet, shaken: 36 numbers."""

    def formulas(lib):
        def rate(y):
            a = [0.0] * 18
            for s in range(len(SPRINGS)):
                i, j = SPRINGS[s]
                dx, dy = y[2 * j] - y[2 * i], y[2 * j + 1] - y[2 * i + 1]
                weight = 1.0 - _LENGTHS[s] / lib.sqrt(dx * dx + dy * dy)
                a[2 * i] = a[2 * i] + weight * dx
                a[2 * i + 1] = a[2 * i + 1] + weight * dy
                a[2 * j] = a[2 * j] - weight * dx
                a[2 * j + 1] = a[2 * j + 1] - weight * dy
            return [y[18 + i] for i in range(18)] + a

        return rate

    rest = np.array([(i // 3, i % 3) for i in range(9)], float).ravel()
    noise = np.random.default_rng(0).standard_normal(18)
    start = np.concatenate([rest + _SHAKEN * noise, np.zeros(18)])
    springs = SpringNetwork(SPRINGS, jnp.ones(len(SPRINGS)), jnp.array(_LENGTHS))
    return from_start(Scene(FreePoints(jnp.ones(9)), (springs,), y0=start, t1=50.0), formulas)


class _HenonHeiles(Effect):
    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        x, y = r[0]
        return 0.5 * (x * x + y * y) + x * x * y - y * y * y / 3


def henon_heiles() -> Problem:
    """A regular motion in the potential of Henon and Heiles, energy 1/12, some 50 turns."""

    def formulas(lib):
        def rate(s):
            x, y, u, v = s[0], s[1], s[2], s[3]
            return [u, v, -x - 2.0 * x * y, y * y - y - x * x]

        return rate

    y = 0.1
    speed = math.sqrt(1 / 6 - y * y + 2 * y**3 / 3)
    start = [0.0, y, speed, 0.0]
    return from_start(Scene(FreePoints(1.0), (_HenonHeiles(),), y0=start, t1=300.0), formulas)


_G, _DRAG, _SPEED = 9.81, 0.01, 100.0
_THROWS = 100


def cannonball() -> Problem:
    """Throws at 100 m/s at 100 angles, ten seconds each, with quadratic drag."""

    def formulas(lib):
        def rate(s):
            u, v = s[2], s[3]
            drag = _DRAG * lib.sqrt(u * u + v * v)
            return [u, v, -drag * u, -drag * v - _G]

        return rate

    angles = np.linspace(0.1, 1.5, _THROWS)
    y0s = _SPEED * np.stack([0 * angles, 0 * angles, np.cos(angles), np.sin(angles)], axis=1)
    return Problem(scenes.cannonball(drag=_DRAG, g=_G, t1=10.0), formulas, y0s)


def double_pendulum() -> Problem:
    """Two hinged bars that swing without tumbling, some 15 times."""

    def formulas(lib):
        def rate(s):
            a, b, u, w = s[0], s[1], s[2], s[3]
            c, x = 0.5 * lib.cos(a - b), 0.5 * lib.sin(a - b)
            first = -x * w * w - 1.5 * lib.sin(a)
            second = x * u * u - 0.5 * lib.sin(b)
            determinant = 4.0 / 9.0 - c * c
            du = (first / 3.0 - c * second) / determinant
            return [u, w, du, (4.0 / 3.0 * second - c * first) / determinant]

        return rate

    return from_start(scenes.double_pendulum(angles=(0.8, 0.5), t1=100.0), formulas)


def rigid_body() -> Problem:
    """A body that tumbles freely: centre, quaternion, velocity, angular velocity."""
    one, two, three = moments = (1.0, 2.0, 3.0)

    def formulas(lib):
        def rate(s):
            w, x, y, z, p, q, r = s[3], s[4], s[5], s[6], s[10], s[11], s[12]
            turning = [
                0.5 * (-x * p - y * q - z * r),
                0.5 * (w * p + y * r - z * q),
                0.5 * (w * q + z * p - x * r),
                0.5 * (w * r + x * q - y * p),
            ]
            spin = [(two - three) / one * q * r, (three - one) / two * r * p]
            spin = [*spin, (one - two) / three * p * q]
            return [s[7], s[8], s[9], *turning, 0.0 * s[7], 0.0 * s[8], 0.0 * s[9], *spin]

        return rate

    scene = scenes.free_body((0.3, 1.0, 0.2), moments=moments, t1=1000.0)
    return from_start(scene, formulas)


_MU = 5.0


def _van_der_pol(t, y, mu):
    x, v = y
    return [v, mu * (1 - x * x) * v - x]


def van_der_pol() -> Problem:
    """Thirty cycles of van der Pol's oscillator with mu = 5."""

    def formulas(lib):
        def rate(y):
            return [y[1], _MU * (1.0 - y[0] * y[0]) * y[1] - y[0]]

        return rate

    scene = jaxdyn.ode(_van_der_pol, [2.0, 0.0], 350.0, names=["x", "v"], params=_MU)
    return from_start(scene, formulas)


#: Problems with velocity-independent forces.
CONSERVATIVE = {
    "Kepler, e = 0.9": kepler,
    "spring network": sheet,
    "Henon-Heiles": henon_heiles,
}
#: Problems of any kind, in runs of a millisecond or more.
GENERAL = {
    "cannonball": cannonball,
    "double pendulum": double_pendulum,
    "rigid body": rigid_body,
    "van der Pol": van_der_pol,
}
