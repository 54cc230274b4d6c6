"""Guesses of orbits of a massless body near two that circle each other, by linear theory.

About the collinear libration points, small motions are sums of an oscillation in the plane, one
perpendicular to it, and a hyperbolic part. Lyapunov and vertical orbits are the two oscillations.
Halo orbits begin where a larger planar orbit has the period of the vertical one, and are guessed by
Richardson's series to third order; axial ones, which begin at a still larger planar orbit, by a
table. About L4 and L5 there are an oscillation of short and one of long period in the plane, and
one perpendicular to it. Distant retrograde orbits are guessed as circles about the second body, and
resonant ones as ellipses about the first, in the rotating axes.

Reference: Richardson (1980), Celestial Mechanics 22, 241; Henon (1969), Astronomy and Astrophysics
1, 223, for retrograde orbits; Szebehely (1967), Theory of Orbits, chapter 5, for L4 and L5.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import array, check_first, choice, fail, positive, whole
from jaxdyn.scenes.restricted import RestrictedProblem, libration_point, restricted
from orbits.discovery.seeds import Seed

#: Default amplitudes relative to the distance of the point from the nearest body.
_PLANAR, _VERTICAL = 0.05, 0.1
_NEAR = 0.5  # radius of a distant retrograde orbit, relative to that of Hill's sphere


class _Guess(NamedTuple):
    """A start (x, y, z, vx, vy, vz), in the units of the two bodies, and the period."""

    start: tuple[float, float, float, float, float, float]
    period: float


def _across(x: float, z: float, vy: float, period: float) -> _Guess:
    """An orbit that crosses the xz plane at a right angle."""
    return _Guess((x, 0.0, z, 0.0, vy, 0.0), period)


@check_first
def near_libration_point(
    scene: Scene,
    family: str = "halo",
    point: str = "L1",
    *,
    amplitude: float | None = None,
    southern: bool = False,
) -> Seed:
    """A guess of an orbit of a family near a libration point, or about the second body.

    ``orbits.find(scene.starting(seed.y0), period=seed.period, closing=orbits.closing.mirror(scene),
    hold=...)`` finds the orbit, `orbits.continue_family` its family. Axial orbits are symmetric
    about the x axis, ``orbits.closing.mirror(scene, "x")``; those about L4 and L5 have no such
    symmetry. Other families branch off these, see `orbits.switch_branch`. For resonant orbits see
    `resonant`.

    Args:
      scene: `scenes.restricted_three_body_in_space`, in either units; `restricted_three_body` for
        planar orbits.
      family: "halo", "lyapunov", "vertical", "axial", "short period", "long period", or "distant
        retrograde" (about the second body).
      point: "L1", "L2" or "L3", but only the first two for halo and axial orbits; "L4" or "L5" for
        vertical orbits and those of short and long period.
      amplitude: amplitude along x for planar orbits, along z for vertical and halo orbits, distance
        from the second body for retrograde ones, in the scene's unit; small by default. None for
        axial ones.
      southern: the mirror image of a halo, vertical or axial orbit; most of a halo orbit is then
        below the plane.
    Raises:
      ValueError: another scene, family or point, `amplitude` is not > 0 or far too large for the
        series, or `mu` is so large that L4 and L5 are unstable.
    Limits: the guess is of second or third order in the amplitude; large orbits are reached along
      the family. The amplitude must be so large that rounding of the position of the point is below
      the goal of `find`. About L3 both oscillations have nearly the same period, and vertical
      orbits cannot be distinguished from others. Axial orbits need a `mu` up to that of the Moon.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> scene = scenes.restricted_three_body_in_space(system="earth-moon")
      >>> seed = orbits.discovery.libration.near_libration_point(scene, "halo", "L1")
      >>> mirror = orbits.closing.mirror(scene)
      >>> halo = orbits.find(scene, seed.y0, seed.period, closing=mirror, hold="z")
      >>> halo.ok, round(halo.period, 2)  # days
      (True, 12.17)
    """
    kind, k = _FAMILIES[choice("family", family, list(_FAMILIES))], len(scene.y0)
    system = restricted(scene)
    if choice("point", point, _POINTS) not in kind.points:
        fitting = [name for name, other in _FAMILIES.items() if point in other.points]
        remedy = f"Near {point} are {', '.join(fitting)} orbits."
        raise fail("point", f"one of {', '.join(kind.points)} for {family} orbits", point, remedy)
    if amplitude is not None:
        positive("amplitude", amplitude, "It is a distance.")
        if not kind.sized:
            raise fail("amplitude", f"none for {family} orbits", amplitude, "Follow the family.")
    if k == 4 and not kind.planar:
        raise fail("family", "a planar one in a scene of the plane", family)
    units = np.asarray(system.units)
    place = np.asarray(libration_point(scene, point))[:2] / units[:2]
    size = None if amplitude is None else amplitude / float(units[0])
    if size is not None and not size < 1:
        wanted = f"less than the distance of the two bodies, {units[0]:g}"
        raise fail("amplitude", wanted, amplitude, "It is in the scene's unit of length.")
    guess = kind.guess(float(system.mu), place, size)
    if not guess.period > 0:  # far beyond where the series means anything
        remedy = "Begin with a smaller orbit, and follow the family."
        raise fail("amplitude", "one for which the series has a period > 0", amplitude, remedy)
    mirrored = [1, 1, -1, 1, 1, -1] if southern else [1] * 6
    return _seed(system, np.array(guess.start) * mirrored, guess.period)


@check_first
def resonant(
    scene: Scene, turns: int, per: int, *, eccentricity: float = 0.2, towards: bool = True
) -> Seed:
    """A guess of an orbit about the first body that is in resonance with the second.

    It is an ellipse on which the body completes `turns` turns about the first one while the second
    one completes `per` turns, which is the period in the rotating axes. It has its pericentre on
    the x axis, which it crosses at a right angle there: ``closing=orbits.closing.mirror(scene)``
    and ``hold="x"`` suit.

    Args:
      scene: `scenes.restricted_three_body_in_space` or `restricted_three_body`.
      turns: number of turns of the body.
      per: number of turns of the second body, coprime to `turns`.
      eccentricity: eccentricity of the ellipse, at least 0 and below 1.
      towards: whether the pericentre at the start is on the side of the second body.
    Raises:
      ValueError: another scene, numbers of turns with a common divisor, or no such eccentricity.
    Limits: the second body is ignored: for a large `mu`, or where the ellipse passes near it, the
      guess is rough.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> scene = scenes.restricted_three_body(mu=1e-3)
      >>> seed = orbits.discovery.libration.resonant(scene, 2, 1, eccentricity=0.3)
      >>> mirror = orbits.closing.mirror(scene, "x")
      >>> found = orbits.find(scene, seed.y0, seed.period, closing=mirror, hold="x")
      >>> bool(abs(found.period / (2 * math.pi) - 1) < 0.01)
      True
    """
    system = restricted(scene)
    mu = float(system.mu)
    p, q = whole("turns", turns), whole("per", per)
    if math.gcd(p, q) > 1:
        reduced = f"{p // math.gcd(p, q)}, {q // math.gcd(p, q)}"
        raise fail("turns, per", "numbers without a common divisor", f"{p}, {q}", f"Say {reduced}?")
    e = float(array("eccentricity", eccentricity, ()))
    if not 0 <= e < 1:
        raise fail("eccentricity", "at least 0 and below 1", e, "Others never return.")
    # Kepler's third law, about the first body alone, in units in which the second one turns once
    # in 2 pi at a distance of 1.
    axis = (1 - mu) ** (1 / 3) * (q / p) ** (2 / 3)
    near = axis * (1 - e)
    speed = math.sqrt((1 - mu) * (1 + e) / near)
    side = 1.0 if towards else -1.0
    start = (side * near - mu, 0.0, 0.0, 0.0, side * (speed - near), 0.0)
    return _seed(system, np.array(start), 2 * math.pi * q)


def _seed(system: RestrictedProblem, start: np.ndarray, period: float) -> Seed:
    """A seed in the units of a scene, from a start (6,) and a period in those of the two bodies."""
    units = np.asarray(system.units)
    y = start if len(units) == 6 else start[[0, 1, 3, 4]]
    return Seed(y * units, period * float(system.unit_of_time))


class _Linear(NamedTuple):
    """A libration point on the axis.

    Attributes:
      gamma: its distance from the nearest body.
      c: the coefficients c_2, c_3, c_4 of the potential there, in units of that distance.
      turn: frequency of the oscillation in the plane.
      k: its extent along y over that along x.
    """

    gamma: float
    c: tuple[float, float, float]
    turn: float
    k: float


def _linear(mu: float, x: float) -> _Linear:
    one, two = x + mu, x - 1 + mu
    near, far, heavy, light = (one, two, 1 - mu, mu) if x < -mu else (two, one, mu, 1 - mu)
    gamma = abs(near)

    def c(n: int) -> float:
        """The coefficient of the n-th Legendre polynomial about the point, along x."""
        parts = ((heavy, near), (light, far))
        return sum(
            m * (-math.copysign(1, r) * gamma / abs(r)) ** n / abs(r) / gamma**2 for m, r in parts
        )

    c2, c3, c4 = (c(n) for n in (2, 3, 4))
    square = 0.5 * (2 - c2 + math.sqrt(9 * c2**2 - 8 * c2))
    turn = math.sqrt(square)
    return _Linear(gamma, (c2, c3, c4), turn, (square + 1 + 2 * c2) / (2 * turn))


def _lyapunov(mu: float, place: np.ndarray, amplitude: float | None) -> _Guess:
    x = float(place[0])
    point = _linear(mu, x)
    size = _PLANAR * point.gamma if amplitude is None else amplitude
    return _across(x - size, 0.0, point.k * point.turn * size, 2 * math.pi / point.turn)


def _vertical(mu: float, place: np.ndarray, amplitude: float | None) -> _Guess:
    x, y = map(float, place)
    if y:
        size = _PLANAR if amplitude is None else amplitude
        return _about_triangular(mu, place, np.array([0.0, 0.0, size]), 1.0)
    point = _linear(mu, x)
    size = _VERTICAL * point.gamma if amplitude is None else amplitude
    return _across(x, size, 0.0, 2 * math.pi / math.sqrt(point.c[0]))


def _axial(mu: float, place: np.ndarray, amplitude: float | None) -> _Guess:
    """From the table, whose rows differ little in units of the distance from the second body."""
    del amplitude
    x = float(place[0])
    gamma = abs(x - 1 + mu)
    rows = np.array(_AXIAL["L1" if x < 1 - mu else "L2"])
    across, vy, vz, period = (float(np.interp(gamma, rows[:, 0], row)) for row in rows.T[1:])
    return _Guess((x + gamma * across, 0.0, 0.0, 0.0, gamma * vy, gamma * vz), period)


def _triangular(mu: float, place: np.ndarray, amplitude: float | None, *, sign: int) -> _Guess:
    """An oscillation in the plane about L4 or L5, from its farthest point along x."""
    root = 1 - 27 * mu * (1 - mu)
    if root <= 0:
        wanted = "one of less than 0.0385209, where L4 and L5 are stable"
        raise fail("mu", wanted, mu, "There are no oscillations about them in the plane.")
    square = 0.5 * (1 + sign * math.sqrt(root))
    turn, mixed = math.sqrt(square), 1.5 * float(place[1]) * (1 - 2 * mu)
    # From x'' - 2 y' = 3/4 x + mixed y, with x = exp(i turn t) and y = ratio exp(i turn t).
    ratio = -(square + 0.75) / complex(mixed, 2 * turn)
    size = _PLANAR if amplitude is None else amplitude
    return _about_triangular(mu, place, size * np.array([1.0, ratio, 0.0]), turn)


def _about_triangular(mu: float, place: np.ndarray, first: np.ndarray, turn: float) -> _Guess:
    """The oscillation Re(first exp(i turn t)) about L4 or L5 from t = 0, to second order.

    The quadratic terms of the force shift the centre of the oscillation, and add one of twice the
    frequency. Without them the guess would be far from any orbit for a small `mu`, for which the
    restoring force along the circle about the first body is weak.
    """
    one = np.eye(3)
    third = np.zeros((3, 3, 3))  # derivatives of the potential
    for m, x in ((1 - mu, 0.5), (mu, -0.5)):
        n = np.array([x, place[1], 0.0])  # from the body, at a distance of 1
        s = np.einsum("ab,c", one, n)
        s = s + s.transpose(0, 2, 1) + s.transpose(2, 1, 0)
        third += m * (3 * s - 15 * np.einsum("a,b,c", n, n, n))
    mixed = 1.5 * place[1] * (1 - 2 * mu)
    slope = np.array([[0.75, mixed, 0.0], [mixed, 2.25, 0.0], [0.0, 0.0, -1.0]])
    turning = np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    steady = 0.25 * np.einsum("abc,b,c", third, first, first.conj()).real
    double = 0.25 * np.einsum("abc,b,c", third, first, first)
    fast = 2j * turn
    centre = -np.linalg.solve(slope, steady)
    second = np.linalg.solve(fast**2 * one + fast * turning - slope, double)
    r = np.append(place, 0.0) + (first + second).real + centre
    v = (1j * turn * first + fast * second).real
    return _Guess((*r.tolist(), *v.tolist()), 2 * math.pi / turn)


def _retrograde(mu: float, place: np.ndarray, amplitude: float | None) -> _Guess:
    del place
    r = _NEAR * (mu / 3) ** (1 / 3) if amplitude is None else amplitude
    turn = math.sqrt(mu / r**3) + 1  # in the axes, which rotate in the opposite direction
    return _across(1 - mu - r, 0.0, r * turn, 2 * math.pi / turn)


def _halo(mu: float, place: np.ndarray, amplitude: float | None) -> _Guess:
    """Richardson's series, at the crossing with the largest z."""
    x = float(place[0])
    point = _linear(mu, x)
    az = _VERTICAL if amplitude is None else amplitude / point.gamma
    (c2, c3, c4), w, k = point.c, point.turn, point.k
    w2 = w * w
    d1 = 3 * w2 / k * (k * (6 * w2 - 1) - 2 * w)
    d2 = 8 * w2 / k * (k * (11 * w2 - 1) - 2 * w)
    a21 = 3 * c3 * (k * k - 2) / (4 * (1 + 2 * c2))
    a22 = 3 * c3 / (4 * (1 + 2 * c2))
    a23 = -3 * c3 * w / (4 * k * d1) * (3 * k**3 * w - 6 * k * (k - w) + 4)
    a24 = -3 * c3 * w / (4 * k * d1) * (2 + 3 * k * w)
    b21 = -3 * c3 * w / (2 * d1) * (3 * k * w - 4)
    b22 = 3 * c3 * w / d1
    d21 = -c3 / (2 * w2)
    p = 4 * c3 * (k * a23 - b21) + k * c4 * (4 + k * k)
    q = 3 * c3 * (2 * a23 - k * b21) + c4 * (2 + 3 * k * k)
    r = 4 * c3 * (k * a24 - b22) + k * c4
    s = c3 * (k * b22 + d21 - 2 * a24) - c4
    a31 = -9 * w / (4 * d2) * p + (9 * w2 + 1 - c2) / (2 * d2) * q
    a32 = -(9 * w / 4 * r + 1.5 * (9 * w2 + 1 - c2) * s) / d2
    b31 = 3 / (8 * d2) * (-8 * w * q + (9 * w2 + 1 + 2 * c2) * p)
    b32 = (9 * w * s + 3 / 8 * (9 * w2 + 1 + 2 * c2) * r) / d2
    d31 = 3 / (64 * w2) * (4 * c3 * a24 + c4)
    d32 = 3 / (64 * w2) * (4 * c3 * (a23 - d21) + c4 * (4 + k * k))
    scale = 1 / (2 * w * (w * (1 + k * k) - 2 * k))
    s1 = scale * (
        1.5 * c3 * (2 * a21 * (k * k - 2) - a23 * (k * k + 2) - 2 * k * b21)
        - 3 / 8 * c4 * (3 * k**4 - 8 * k * k + 8)
    )
    s2 = scale * (
        1.5 * c3 * (2 * a22 * (k * k - 2) + a24 * (k * k + 2) + 2 * k * b22 + 5 * d21)
        + 3 / 8 * c4 * (12 - k * k)
    )
    a1 = -1.5 * c3 * (2 * a21 + a23 + 5 * d21) - 3 / 8 * c4 * (12 - k * k)
    a2 = 1.5 * c3 * (a24 - 2 * a22) + 9 / 8 * c4
    l1, l2 = a1 + 2 * w2 * s1, a2 + 2 * w2 * s2
    # The vertical oscillation has the period of the planar one.
    ax = math.sqrt((-(w2 - c2) - l2 * az * az) / l1)
    faster = 1 + s1 * ax * ax + s2 * az * az
    across = a21 * ax**2 + a22 * az**2 - ax + a23 * ax**2 - a24 * az**2
    across += a31 * ax**3 - a32 * ax * az**2
    up = az + d21 * ax * az * (1 - 3) + d32 * az * ax**2 - d31 * az**3
    speed = k * ax + 2 * (b21 * ax**2 - b22 * az**2) + 3 * (b31 * ax**3 - b32 * ax * az**2)
    # In a northern orbit the part far from the second body is above the plane; this crossing
    # belongs to that part only about L1.
    gamma, north = point.gamma, 1 if x < 1 - mu else -1
    return _across(
        x + gamma * across,
        north * gamma * up,
        gamma * w * faster * speed,
        2 * math.pi / (w * faster),
    )


#: Axial orbits in units of the distance gamma of the point from the second body: gamma, then x from
#: the point, vy, vz and the period where it crosses the axis x; in Hill's problem, the limit of
#: small bodies [shooting with SciPy], of the Sun with the Earth, and of the Earth with the Moon
#: [computed by this library along families of Lyapunov orbits].
_AXIAL = {
    "L1": (
        (0.0, -0.294266, 2.537295, 1.0, 4.151036),
        (0.00997, -0.29575, 2.54946, 1.0, 4.13944),
        (0.15093, -0.31792, 2.74424, 1.0, 3.96796),
    ),
    "L2": (
        (0.0, -0.678802, 3.780107, 1.5, 4.134288),
        (0.01003, -0.68310, 3.79091, 1.5, 4.14527),
        (0.16783, -0.74093, 3.95793, 1.5, 4.31569),
    ),
}

_POINTS = ("L1", "L2", "L3", "L4", "L5")


class _Family(NamedTuple):
    """A family of orbits.

    Attributes:
      guess: (mu, place of the point, amplitude) -> a guess.
      points: the points near which the family exists.
      planar: whether its orbits lie in the plane.
      sized: whether a guess may have any amplitude.
    """

    guess: Callable[[float, np.ndarray, float | None], _Guess]
    points: tuple[str, ...]
    planar: bool = True
    sized: bool = True


_FAMILIES = {
    "halo": _Family(_halo, _POINTS[:2], planar=False),
    "lyapunov": _Family(_lyapunov, _POINTS[:3]),
    "vertical": _Family(_vertical, _POINTS, planar=False),
    "axial": _Family(_axial, _POINTS[:2], planar=False, sized=False),
    "short period": _Family(functools.partial(_triangular, sign=1), _POINTS[3:]),
    "long period": _Family(functools.partial(_triangular, sign=-1), _POINTS[3:]),
    "distant retrograde": _Family(_retrograde, _POINTS),
}
