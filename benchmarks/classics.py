"""Well-known problems for which no method was tuned, as formulas and as scenes.

The formulas are given as in `benchmarks.problems`; the scenes are made from them by `jaxdyn.ode`,
or consist of free points and their effects.
"""

import functools
import math
from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpy as np

import jaxdyn
from benchmarks.problems import Problem, from_start, gravity
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Scene


@functools.cache
def _rate(formulas: Callable) -> Callable:
    numbers = formulas(jnp)
    return lambda t, y: numbers(y)


def ode_of(
    formulas: Callable, y0: Sequence[float], t1: float, second_order: bool = False
) -> Problem:
    """A problem from its formulas alone."""
    scene = jaxdyn.ode(_rate(formulas), y0, t1, second_order=second_order)
    return from_start(scene, formulas)


def lorenz() -> Problem:
    """The Lorenz system for ten units of time: errors grow by a factor of 1e4."""

    def formulas(lib):
        def rate(y):
            return [10.0 * (y[1] - y[0]), y[0] * (28.0 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]]

        return rate

    return ode_of(formulas, [1.0, 1.0, 1.0], 10.0)


def _restricted_rate(mu: float) -> Callable:
    """The circular restricted three-body problem in its rotating frame, in space."""

    def formulas(lib):
        def rate(s):
            x, y, z, u, v, w = (s[i] for i in range(6))
            far, near = x + mu, x - (1 - mu)
            r2, q2 = far * far + y * y + z * z, near * near + y * y + z * z
            a, b = (1 - mu) / (r2 * lib.sqrt(r2)), mu / (q2 * lib.sqrt(q2))
            pull = a + b
            return [
                u, v, w,
                2.0 * v + x - a * far - b * near,
                y - 2.0 * u - pull * y,
                -pull * z,
            ]  # fmt: skip

        return rate

    return formulas


def arenstorf() -> Problem:
    """Arenstorf's closed orbit about Earth and Moon (Hairer, Norsett, Wanner, II.0)."""
    mu = 0.012277471

    def formulas(lib):
        space = _restricted_rate(mu)(lib)

        def rate(s):
            zero = 0.0 * s[0]
            there = space([s[0], s[1], zero, s[2], s[3], zero])
            return [there[i] for i in (0, 1, 3, 4)]

        return rate

    return ode_of(formulas, [0.994, 0.0, 0.0, -2.00158510637908252240537862224], 17.06521656015796)


def restricted_in_space() -> Problem:
    """About the Moon and out of the plane, six units of time."""
    start = [0.8233909, 0.0, 0.0225, 0.0, 0.1341840, 0.0]
    return ode_of(_restricted_rate(0.0121505856), start, 6.0)


def spherical_pendulum() -> Problem:
    """A pendulum in space in two angles, t = 200."""

    def formulas(lib):
        def rate(s):
            sine, cosine = lib.sin(s[0]), lib.cos(s[0])
            turn = s[3] * s[3] * sine * cosine - sine
            return [s[2], s[3], turn, -2.0 * cosine / sine * s[2] * s[3]]

        return rate

    return ode_of(formulas, [1.0, 0.0, 0.0, 0.8], 200.0)


def toda() -> Problem:
    """Toda's ring of six particles, t = 15."""
    n = 6

    def formulas(lib):
        def rate(s):
            pull = [lib.exp(s[i] - s[(i + 1) % n]) for i in range(n)]
            return [s[n + i] for i in range(n)] + [pull[i - 1] - pull[i] for i in range(n)]

        return rate

    random = np.random.default_rng(6)
    start = np.concatenate([0.5 * random.standard_normal(n), random.standard_normal(n)])
    return ode_of(formulas, start, 15.0, second_order=True)


def duffing() -> Problem:
    """Duffing's driven oscillator, ten periods of the forcing, whose phase is a state variable."""

    def formulas(lib):
        def rate(s):
            x, v, phase = s[0], s[1], s[2]
            return [v, x - x * x * x - 0.3 * v + 0.5 * lib.cos(phase), 1.2 + 0.0 * v]

        return rate

    return ode_of(formulas, [1.0, 0.0, 0.0], 20 * math.pi / 1.2)


def chua() -> Problem:
    """Chua's circuit with a cubic resistance, t = 20."""

    def formulas(lib):
        def rate(s):
            x, y, z = s[0], s[1], s[2]
            return [10.0 * (y - (2.0 * x * x * x - x) / 7.0), x - y + z, -100.0 / 7.0 * y]

        return rate

    return ode_of(formulas, [0.6, 0.1, -0.6], 20.0)


def lotka_volterra() -> Problem:
    """Predators and prey, some ten cycles."""

    def formulas(lib):
        def rate(s):
            return [s[0] * (1.5 - s[1]), s[1] * (s[0] - 1.0)]

        return rate

    return ode_of(formulas, [2.0, 1.0], 50.0)


def bottle() -> Problem:
    """A charged particle in a magnetic bottle, some 50 turns."""

    def formulas(lib):
        def rate(s):
            x, y, z, u, v, w = (s[i] for i in range(6))
            bx, by = -x * z, -y * z
            bz = 1.0 + z * z - 0.5 * (x * x + y * y)
            return [u, v, w, v * bz - w * by, w * bx - u * bz, u * by - v * bx]

        return rate

    return ode_of(formulas, [0.1, 0.0, 0.0, 0.0, 0.2, 0.1], 300.0)


def links() -> Problem:
    """Five point masses on a chain of five massless rods, t = 5."""
    n = 5

    def formulas(lib):
        def rate(s):
            weight = [[float(n - max(i, j)) for j in range(n)] for i in range(n)]
            matrix = [
                [weight[i][j] * lib.cos(s[i] - s[j]) if i != j else weight[i][i] for j in range(n)]
                for i in range(n)
            ]
            pulls = []
            for i in range(n):
                total = -9.81 * (n - i) * lib.sin(s[i])
                for j in range(n):
                    if i != j:
                        turn = lib.sin(s[i] - s[j]) * s[n + j] * s[n + j]
                        total = total - weight[i][j] * turn
                pulls.append(total)
            return [s[n + i] for i in range(n)] + _eliminate(matrix, pulls)

        return rate

    return ode_of(formulas, [0.5, 0.4, 0.3, 0.2, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0], 5.0)


def _eliminate(matrix: list[list], right: list) -> list:
    """The solution of a symmetric positive definite system, without pivots."""
    a, b, n = [list(row) for row in matrix], list(right), len(right)
    for k in range(n):
        for i in range(k + 1, n):
            factor = a[i][k] / a[k][k]
            for j in range(k + 1, n):
                a[i][j] = a[i][j] - factor * a[k][j]
            b[i] = b[i] - factor * b[k]
    x = [0.0] * n
    for k in reversed(range(n)):
        total = b[k]
        for j in range(k + 1, n):
            total = total - a[k][j] * x[j]
        x[k] = total / a[k][k]
    return x


def pleiades() -> Problem:
    """Seven stars in the plane, t = 3 (Hairer, Norsett, Wanner, II.10)."""
    x, y = [3, 3, -1, -3, 2, -2, 2], [3, -3, 2, 0, 0, -4, 4]
    u, v = [0, 0, 0, 0, 0, 1.75, -1.5], [0, 0, 0, -1.25, 1, 0, 0]
    start = np.array([np.stack([x, y], 1), np.stack([u, v], 1)], float).ravel()
    return _attracting(range(1, 8), start, 2, 3.0, 1.0)


_DAY_G = 2.95912208286e-4  # [au^3 / (day^2 solar mass)]


def outer_planets() -> Problem:
    """The Sun, four planets and Pluto for 100 years (Hairer, Lubich, Wanner, I.2.4)."""
    m = [1.00000597682, 9.54786104043e-4, 2.85583733151e-4, 4.37273164546e-5, 5.17759138449e-5]
    r = [
        [0, 0, 0],
        [-3.5023653, -3.8169847, -1.5507963],
        [9.0755314, -3.0458353, -1.6483708],
        [8.3101420, -16.2901086, -7.2521278],
        [11.4707666, -25.7294829, -10.8169456],
        [-15.5387357, -25.2225594, -3.1902382],
    ]
    v = [
        [0, 0, 0],
        [0.00565429, -0.00412490, -0.00190589],
        [0.00168318, 0.00483525, 0.00192462],
        [0.00354178, 0.00137102, 0.00055029],
        [0.00288930, 0.00114527, 0.00039677],
        [0.00276725, -0.00170702, -0.00136504],
    ]
    return _attracting([*m, 1 / 1.3e8], np.array([r, v]).ravel(), 3, 36525.0, _DAY_G)


def _attracting(m: Sequence[float], start: np.ndarray, d: int, t1: float, g: float) -> Problem:
    masses = [float(each) for each in m]
    scene = Scene(FreePoints(masses, d=d), (PairGravity(g),), y0=start, t1=t1)
    return from_start(scene, gravity(masses, d, g))


CLASSICS = {
    "Lorenz": lorenz,
    "Arenstorf": arenstorf,
    "spherical pendulum": spherical_pendulum,
    "Toda": toda,
    "Duffing": duffing,
    "Chua": chua,
    "Lotka-Volterra": lotka_volterra,
    "magnetic bottle": bottle,
    "Pleiades": pleiades,
    "outer planets": outer_planets,
    "five links": links,
    "restricted, in space": restricted_in_space,
}
