"""Motions known in closed form, to 30 digits from the very numbers that a scene was given.

Two more are known from references/long_spans_reference.py.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, NamedTuple

import mpmath
import numpy as np
from helpers import kepler
from mpmath import mp, mpf
from odes import stuart_landau

import jaxdyn
from jaxdyn import Effect, Scene, scenes
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.hard.cases import long


class Known(NamedTuple):
    """A scene, a span, its exact states (s, k) at times (s,), and which entries they cover."""

    scene: Scene
    t1: float
    exact: Callable[[np.ndarray], np.ndarray]
    entries: slice = slice(None)
    times: np.ndarray | None = None

    @property
    def samples(self) -> np.ndarray:
        """Times over the span at which its states are known."""
        return np.linspace(0.0, self.t1, 9)[1:] if self.times is None else self.times


def _rows(fn, y0) -> Callable[[np.ndarray], np.ndarray]:
    """Rows of doubles from fn(t, *y0) with 30 digits."""
    start = [mpf(float(y)) for y in y0]

    def exact(ts):
        with mp.workdps(30):
            return np.array([[float(y) for y in fn(mpf(float(t)), *start)] for t in ts])

    return exact


def _harmonic(w2, centre):
    """Every coordinate swings with w^2 = w2 about its centre."""

    def state(t, *y0):
        n, w = len(y0) // 2, mp.sqrt(w2)
        c, s = mp.cos(w * t), mp.sin(w * t)
        arms = [r - o for r, o in zip(y0[:n], centre, strict=True)]
        r = [o + a * c + v / w * s for o, a, v in zip(centre, arms, y0[n:], strict=True)]
        return r + [v * c - a * w * s for a, v in zip(arms, y0[n:], strict=True)]

    return state


def _damped(k, c):
    def state(t, x, v):
        g, w = c / 2, mp.sqrt(k - c * c / 4)
        s, co, e = mp.sin(w * t), mp.cos(w * t), mp.exp(-g * t)
        return e * (x * co + (v + g * x) / w * s), e * (v * co - (k * x + g * v) / w * s)

    return state


def _ellipse(mu):
    """The state of a planar orbit about a fixed centre."""

    def state(t, x, y, vx, vy):
        r, v2, rv = mp.hypot(x, y), vx * vx + vy * vy, x * vx + y * vy
        a = 1 / (2 / r - v2 / mu)
        n = mp.sqrt(mu / a**3)
        ec, es = 1 - r / a, rv / mp.sqrt(mu * a)  # e cos E0, e sin E0
        # Kepler's equation for the change d of the eccentric anomaly.
        d = n * t
        for _ in range(60):
            f = d - ec * mp.sin(d) + es * (1 - mp.cos(d)) - n * t
            d -= f / (1 - ec * mp.cos(d) + es * mp.sin(d))
        rho = a * (1 - ec * mp.cos(d) + es * mp.sin(d))
        f = 1 - a / r * (1 - mp.cos(d))
        g = t - (d - mp.sin(d)) / n
        df, dg = -mp.sqrt(mu * a) / (rho * r) * mp.sin(d), 1 - a / rho * (1 - mp.cos(d))
        return f * x + g * vx, f * y + g * vy, df * x + dg * vx, df * y + dg * vy

    return state


def _two_bodies(m1, m2, G):
    def state(t, *y0):
        a, b, va, vb = (y0[i : i + 2] for i in (0, 2, 4, 6))
        total = m1 + m2
        relative = [q - p for p, q in zip((*a, *va), (*b, *vb), strict=True)]
        moved = _ellipse(G * total)(t, *relative)
        out = []
        for share in (-m2 / total, m1 / total):
            for i in range(4):
                drift = (m1 * va[i % 2] + m2 * vb[i % 2]) / total
                at = (m1 * a[i % 2] + m2 * b[i % 2]) / total + drift * t if i < 2 else drift
                out.append(at + share * moved[i])
        return out[0:2] + out[4:6] + out[2:4] + out[6:8]

    return state


def _thrown(c, g):
    def state(t, x, y, vx, vy):
        if c == 0:
            return x + vx * t, y + vy * t - g * t * t / 2, vx, vy - g * t
        gone, left = -mp.expm1(-c * t) / c, mp.exp(-c * t)
        fall = g * (t - gone) / c
        return x + vx * gone, y + vy * gone - fall, vx * left, vy * left - g * gone

    return state


def _pendulum(w2):
    """From rest: sin(theta / 2) = k cd(w t, k)."""

    def state(t, angle, rate):
        assert rate == 0
        w, k = mp.sqrt(w2), mp.sin(angle / 2)
        sn, cn, dn = (mp.ellipfun(kind, w * t, m=k * k) for kind in ("sn", "cn", "dn"))
        half = mp.asin(k * cn / dn)
        slope = -k * w * sn * (1 - k * k) / (dn * dn)  # of sin(theta / 2)
        return 2 * half, 2 * slope / mp.cos(half)

    return state


def _spinning(t, *y0):
    a, b, va, vb = (y0[i : i + 2] for i in (0, 2, 4, 6))
    arm = [(q - p) / 2 for p, q in zip(a, b, strict=True)]
    v = [(q - p) / 2 for p, q in zip(va, vb, strict=True)]
    w = (arm[0] * v[1] - arm[1] * v[0]) / (arm[0] ** 2 + arm[1] ** 2)
    c, s = mp.cos(w * t), mp.sin(w * t)
    r = [arm[0] * c - arm[1] * s, arm[0] * s + arm[1] * c]
    v = [-w * r[1], w * r[0]]
    return [-r[0], -r[1], *r, -v[0], -v[1], *v]


def _pushed(t, x1, x2, v1, v2):
    s, v = (t - mp.sin(t)) / 2, (1 - mp.cos(t)) / 2
    return x1 + v1 * t + s, x2 + v2 * t + s, v1 + v, v2 + v


def _sprung(t, x1, x2, v1, v2):
    del v1, v2
    m1, m2, k, force = mpf(1), mpf(2), mpf(100), mpf(1)
    total = m1 + m2
    w = mp.sqrt(k * total / (m1 * m2))
    mean = force * m1 / (k * total)
    stretch, rate = mean * (1 - mp.cos(w * t)), mean * w * mp.sin(w * t)
    centre, speed = force / total * t * t / 2, force / total * t
    first, second = m2 / total, m1 / total
    return (
        x1 + centre - first * stretch,
        x2 + centre + second * stretch,
        speed - first * rate,
        speed + second * rate,
    )


def _straight(t, r, theta, vr, omega):
    x, y = r * mp.cos(theta), r * mp.sin(theta)
    vx = vr * mp.cos(theta) - r * omega * mp.sin(theta)
    vy = vr * mp.sin(theta) + r * omega * mp.cos(theta)
    x, y = x + vx * t, y + vy * t
    r = mp.hypot(x, y)
    return r, mp.atan2(y, x), (x * vx + y * vy) / r, (x * vy - y * vx) / r**2


def _skated(t, x, y, theta, vx, vy, w):
    turned = [mp.cos(theta + w * t), mp.sin(theta + w * t)]
    speed = mp.hypot(vx, vy)
    x += speed / w * (turned[1] - mp.sin(theta))
    y -= speed / w * (turned[0] - mp.cos(theta))
    return x, y, theta + w * t, speed * turned[0], speed * turned[1], w


def _flipping(t, *omega0):
    """Angular velocity of the free body with moments 1, 2, 3: Landau and Lifshitz, section 37."""
    moments = (1, 2, 3)
    assert omega0[2] == 0
    H2 = sum((i * w) ** 2 for i, w in zip(moments, omega0, strict=True))
    T2 = sum(i * w**2 for i, w in zip(moments, omega0, strict=True))
    speed = mp.sqrt((T2 * 3 - H2) / 6)
    k2 = (H2 - T2) / (T2 * 3 - H2)
    quarter = mpmath.ellipk(k2)
    sizes = mp.sqrt((T2 * 3 - H2) / 2), mp.sqrt((H2 - T2) / 2), mp.sqrt((H2 - T2) / 6)
    kinds = zip(sizes, ("dn", "sn", "cn"), strict=True)
    return [size * mp.ellipfun(kind, quarter + speed * t, m=k2) for size, kind in kinds]


class HenonHeiles(Effect):
    """The potential r^2 / 2 + x^2 y - y^3 / 3."""

    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        x, y = r[0]
        return 0.5 * (x * x + y * y) + x * x * y - y**3 / 3


def _to_the_circle(t, x, y):
    r2 = x * x + y * y
    size = mp.sqrt(1 / (r2 + (1 - r2) * mp.exp(-2 * t)))
    c, s = mp.cos(2 * t), mp.sin(2 * t)
    return size * (c * x - s * y), size * (s * x + c * y)


def known() -> dict[str, Known]:
    """All of them by name."""
    found = {}

    def add(name, scene, t1, state, entries=slice(None)):
        y0 = np.asarray(scene.y0)[entries]
        found[name] = Known(scene, t1, _rows(state, y0), entries)

    g, third = mpf(9.81), mpf(0.3)
    add("oscillator", scenes.oscillator(), 10.0, _harmonic(mpf(1), [mpf(0)]))
    add("damped oscillator", scenes.oscillator(c=0.3), 10.0, _damped(mpf(1), third))
    add("hanging spring", scenes.hanging_spring(), 10.0, _harmonic(mpf(10), [0, 0, -g / 10]))
    add("two masses", scenes.two_masses(), 5.0, _sprung)
    add("two bodies", scenes.two_body(), 5.0, _two_bodies(mpf(1), mpf(2), mpf(1)))
    for e in (0.3, 0.6, 0.9):
        state = _two_bodies(mpf(0.5), mpf(0.5), mpf(1))
        add(f"ellipse {e}", kepler(e), 6.0, state)
    add("central gravity", scenes.power_law(n=-2.0), 20.0, _ellipse(mpf(1)))
    add("cannonball", scenes.cannonball(), 1.0, _thrown(mpf(0), g))
    add("cannonball, drag", scenes.cannonball(linear=0.3), 3.0, _thrown(third, g))
    add("pendulum", scenes.pendulum(angle=2.0), 10.0, _pendulum(g))
    add("high pendulum", scenes.pendulum(angle=3.1), 10.0, _pendulum(g))
    add("dumbbell", scenes.dumbbell(), 10.0, _spinning)
    add("pushed rod", scenes.rod_on_line(), 10.0, _pushed)
    add("bead", scenes.bead_on_cycloid(), 10.0, _harmonic(2 * mpf(0.125) * g, [mpf(0)]))
    add("straight line", scenes.polar_particle(), 2.0, _straight)
    add("skate", scenes.one_skate(), 10.0, _skated)
    add("flipping body", scenes.free_body(), 60.0, _flipping, slice(10, 13))
    add(
        "limit cycle",
        jaxdyn.ode(stuart_landau, [0.3, 0.1], params=(1.0, 0.0, 2.0)),
        6.0,
        _to_the_circle,
    )
    return found


#: Part of a period by which spans exceed whole ones, so that no sample has a velocity of 0.
_MORE = 0.37
_TURNS = (10, 100, 300, 1000)


def long_spans() -> dict[str, Known]:
    """Motions over many periods by name, the number of periods last."""
    found = {}

    def add(name, n, scene, period, state, entries=slice(None)):
        t1 = float((n + _MORE) * period)
        found[f"{name} x{n}"] = Known(scene, t1, _rows(state, scene.y0[entries]), entries)

    for n in _TURNS:
        for e in (0.1, 0.3, 0.5, 0.9, 0.99):
            add(f"ellipse {e}", n, kepler(e), 2 * np.pi, _two_bodies(mpf(0.5), mpf(0.5), mpf(1)))
        for e in (0.3, 0.99):
            add(f"from far, {e}", n, long.kepler(e), 2 * np.pi, _ellipse(mpf(1)))
        add("oscillator", n, scenes.oscillator(), 2 * np.pi, _harmonic(mpf(1), [mpf(0)]))
        add("flipping body", n, scenes.free_body(), 40.0, _flipping, slice(10, 13))
    file = Path(__file__).parent / "references" / "long_spans_reference.json"
    for name, kept in json.loads(file.read_text()).items():
        if name.startswith("henon"):
            scene = Scene(FreePoints(1.0), (HenonHeiles(),), y0=kept["start"])
            for t, row in zip(kept["ts"], kept["states"], strict=True):
                rows, at = np.array([row]), np.array([t])
                found[f"{name} {t:g}"] = Known(scene, t, lambda ts, r=rows: r, times=at)
    return found
