"""Guesses of orbits of a body of no mass near two that circle each other, by linear theory.

About the libration points small motions are sums of an oscillation in the plane, one across it, and
a part that grows. Lyapunov orbits and vertical ones are the two oscillations; halo orbits begin
where a larger planar one has the period of the vertical one, and are guessed by Richardson's series
to third order. Distant retrograde orbits are guessed as circles about the second body, in the axes
that turn.

Reference: Richardson (1980), Celestial Mechanics 22, 241; Henon (1969), Astronomy and Astrophysics
1, 223, for retrograde orbits.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import choice, fail, positive
from jaxdyn._records.kinds import check_first
from jaxdyn.scenes.restricted import libration_point, restricted
from orbits.discovery.seeds import Seed

_FLAT, _ACROSS = 0.05, 0.1  # of the distance between a libration point and the nearest body
_NEAR = 0.5  # of the radius of Hill's sphere: that of a distant retrograde orbit


class _Guess(NamedTuple):
    """A start (x, z, vy) across the plane xz, in units of the two bodies, and the period."""

    x: float
    z: float
    vy: float
    period: float


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
    hold=...)`` finds the orbit, `orbits.continue_family` its family. Axial and other families
    branch off these: `orbits.switch_branch`.

    Args:
      scene: `scenes.restricted_three_body_in_space`, in either units; in the plane for planar ones.
      family: "halo", "lyapunov", "vertical", or "distant retrograde" (about the second body).
      point: "L1", "L2" or "L3"; halo orbits of the first two.
      amplitude: along x of Lyapunov orbits, along z of vertical and halo ones, distance from the
        second body of retrograde ones, in the scene's unit; small by default.
      southern: the mirror image of a halo orbit, of which most is below the plane.
    Raises:
      ValueError: another scene, family or point, or `amplitude` is not > 0.
    Limits: to second or third order in the amplitude: large ones are reached along the family.
      Orbits so small that rounding of the place of the point exceeds the goal of `find` need a
      larger one. About L3 both oscillations have nearly one period, and vertical orbits are not
      told from others.
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
    system, k = restricted(scene), len(scene.y0)
    made = _FAMILIES[choice("family", family, list(_FAMILIES))]
    choice("point", point, ("L1", "L2", "L3"))
    if amplitude is not None:
        positive("amplitude", amplitude, "It is a distance.")
    if k == 4 and family in ("halo", "vertical"):
        raise fail("family", "a planar one in a scene of the plane", family)
    units = np.asarray(getattr(system, "units", np.ones(k)))
    mu, time = float(system.mu), float(getattr(system, "time", 1.0))
    there = float(np.asarray(libration_point(scene, point))[0] / units[0])
    guess = made(mu, there, None if amplitude is None else amplitude / float(units[0]))
    z = -guess.z if southern else guess.z
    start = [guess.x, 0.0, 0.0, guess.vy] if k == 4 else [guess.x, 0.0, z, 0.0, guess.vy, 0.0]
    return Seed(np.array(start) * units, guess.period * time)


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
        """Of Legendre's polynomials about the point, along x."""
        parts = ((heavy, near), (light, far))
        return sum(
            m * (-math.copysign(1, r) * gamma / abs(r)) ** n / abs(r) / gamma**2 for m, r in parts
        )

    c2, c3, c4 = (c(n) for n in (2, 3, 4))
    square = 0.5 * (2 - c2 + math.sqrt(9 * c2**2 - 8 * c2))
    turn = math.sqrt(square)
    return _Linear(gamma, (c2, c3, c4), turn, (square + 1 + 2 * c2) / (2 * turn))


def _lyapunov(mu: float, x: float, amplitude: float | None) -> _Guess:
    point = _linear(mu, x)
    size = _FLAT * point.gamma if amplitude is None else amplitude
    return _Guess(x - size, 0.0, point.k * point.turn * size, 2 * math.pi / point.turn)


def _vertical(mu: float, x: float, amplitude: float | None) -> _Guess:
    point = _linear(mu, x)
    size = _ACROSS * point.gamma if amplitude is None else amplitude
    return _Guess(x, size, 0.0, 2 * math.pi / math.sqrt(point.c[0]))


def _retrograde(mu: float, x: float, amplitude: float | None) -> _Guess:
    del x
    r = _NEAR * (mu / 3) ** (1 / 3) if amplitude is None else amplitude
    turn = math.sqrt(mu / r**3) + 1  # in the axes that turn the other way
    return _Guess(1 - mu - r, 0.0, r * turn, 2 * math.pi / turn)


def _halo(mu: float, x: float, amplitude: float | None) -> _Guess:
    """Richardson's series, at the crossing with the largest z."""
    if x < -mu:
        raise fail("point", "L1 or L2 for halo orbits", "L3", "They branch off Lyapunov orbits.")
    point = _linear(mu, x)
    az = _ACROSS if amplitude is None else amplitude / point.gamma
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
    # Of a northern orbit the part that is far from the second body is above the plane; this
    # crossing belongs to it about L1 only.
    gamma, north = point.gamma, 1 if x < 1 - mu else -1
    return _Guess(
        x + gamma * across,
        north * gamma * up,
        gamma * w * faster * speed,
        2 * math.pi / (w * faster),
    )


_FAMILIES: dict[str, Callable[[float, float, float | None], _Guess]] = {
    "halo": _halo,
    "lyapunov": _lyapunov,
    "vertical": _vertical,
    "distant retrograde": _retrograde,
}
