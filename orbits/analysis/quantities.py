"""Numbers of an orbit by which families are drawn: extremes, amplitudes, means, phases of entries.

A quantity is a function of an orbit, or its name: "period", "energy", "jacobi" (Jacobi's constant
of restricted three-body scenes), "multiplier" (the largest absolute value of the non-trivial
Floquet multipliers), and with the name of an entry of the state "max x", "min x", "amplitude x"
(half of the difference of these), "mean x" and "phase x" (the phase lag of its first harmonic
behind a cosine over the period, in radians). In the functions below, a function (t, y) that returns
a number may take the place of an entry.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, simulate
from jaxdyn._checks import check_first, choice, fail
from jaxdyn._text import name_of, second
from jaxdyn.analysis.energy import energy
from jaxdyn.plan import plan_of
from jaxdyn.scenes.restricted import jacobi_constant, restricted
from jaxdyn.vibration.inputs import Output
from orbits.analysis.stability import stability
from orbits.orbit import Orbit

#: Samples of a period. The error of the polynomial of degree 5 between two samples h apart is
#: h^6 / 46080 times the sixth derivative.
_SAMPLES = 2048
#: Accuracy of an extreme at a corner, relative to the largest value.
_RESOLVED = 4 * np.finfo(float).eps
_MOST_PARTS = 256  # largest number of parts of a period that are sampled again

Quantity = Callable[[Orbit], float]


@check_first
def extremes(orbit: Orbit, entry: Output) -> tuple[float, float]:
    """The least and the largest value of an entry of the state over a period.

    Args:
      orbit: any orbit.
      entry: its name, one of those of `Scene.labels`, or a function (t, y) that returns ().
    Raises:
      ValueError: there is no such entry, or the function returns another shape.
    Limits: accurate to about 12 digits, but to 3 to 6 where parts of the period are a thousand
      times faster than the rest, as in relaxation oscillations. Corners, where a force jumps, are
      found to rounding.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> swing = orbits.find(scenes.pendulum(angle=2.0), period=8.3, hold="theta")
      >>> [round(x, 9) for x in extremes(swing, "theta")]
      [-2.0, 2.0]
    """
    return extremes_in_time(orbit, entry)[0]


def extremes_in_time(orbit: Orbit, entry: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """`extremes`, and the times at which they are reached [time of the scene]."""
    if plan_of(orbit.scene.field, len(orbit.y0)).size:
        return _extremes_at_corners(orbit, entry)
    part = orbit.period / _SAMPLES
    y, slopes, curvatures = _along(orbit, entry, _times(orbit))
    slopes, curvatures = part * slopes, part**2 * curvatures
    (a, b, c), (a1, b1, c1) = (
        [x[i : i - 1 or None] for x in (y, slopes, 0.5 * curvatures)] for i in (0, 1)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        # Where the cubic through the ends' values and slopes has slope 0, without cancellation.
        second, third = 3 * (a1 - a) - 2 * b - b1, 2 * (a - a1) + b + b1
        root = -(second + np.copysign(np.sqrt(second**2 - 3 * b * third), second))
        u = np.stack([root / (3 * third), b / root])
        # The value there is that of the polynomial of degree 5, with the ends' curvatures.
        gap, tilt, bend = a1 - a - b - c, b1 - b - 2 * c, c1 - c
        rest = 10 * gap - 4 * tilt + bend + u * (7 * tilt - 15 * gap - 2 * bend)
        rest += u * u * (6 * gap - 3 * tilt + bend)
        tops = np.where((u > 0) & (u < 1), a + u * (b + u * (c + u * rest)), y[0])
    parts = np.where((u > 0) & (u < 1), np.arange(len(a)) + u, 0.0) * orbit.period / _SAMPLES
    ts = np.append(_times(orbit), parts)
    values = np.append(y, tops)
    low, high = int(np.argmin(values)), int(np.argmax(values))
    return (float(values[low]), float(values[high])), (float(ts[low]), float(ts[high]))


def _extremes_at_corners(
    orbit: Orbit, entry: Output
) -> tuple[tuple[float, float], tuple[float, float]]:
    """`extremes_in_time` where forces jump: an extreme may be a corner, which no polynomial has.

    Each round samples only those parts of the last one in which an extreme may still be.
    """
    ts, before, counted = _times(orbit), np.inf, np.ones(_SAMPLES, bool)
    while True:
        y, slopes, _ = _along(orbit, entry, ts)
        low, high = int(np.argmin(y)), int(np.argmax(y))
        steepest = np.maximum(np.abs(slopes[1:]), np.abs(slopes[:-1])) * np.diff(ts)
        above = np.maximum(y[1:], y[:-1]) + steepest - y[high]
        below = y[low] - np.minimum(y[1:], y[:-1]) + steepest
        near = np.flatnonzero(counted & (steepest > 0) & (np.maximum(above, below) >= 0))
        error = np.maximum(above, below)[near].max(initial=0.0)
        # In the end only rounding is left. If very many parts are near, the entry hardly changes.
        if error <= _RESOLVED * np.abs(y).max() or error > 0.5 * before or len(near) > _MOST_PARTS:
            return (float(y[low]), float(y[high])), (float(ts[low]), float(ts[high]))
        before = error
        ts, counted = _within(ts, near)


@check_first
def amplitude(orbit: Orbit, entry: Output) -> float:
    """Half of the distance between the extremes of an entry of the state; see `extremes`."""
    low, high = extremes(orbit, entry)
    return 0.5 * (high - low)


@check_first
def mean(orbit: Orbit, entry: Output) -> float:
    """The mean of an entry of the state over a period; see `extremes`.

    Limits: accurate to about 12 digits, also where forces jump.
    """
    return float(_mean_with_turns(orbit, entry, 0).real)


@check_first
def phase(orbit: Orbit, entry: Output) -> float:
    """The phase p of an entry's first harmonic over a period, cos(2 pi t / T - p).

    In a driven scene this is the phase behind a drive of cos(2 pi t / T).

    Returns:
      The phase, from -pi to pi.
    Limits: those of `mean`.
    """
    return float(-np.angle(_mean_with_turns(orbit, entry, 1)))


def _mean_with_turns(orbit: Orbit, entry: Output, turns: int) -> complex:
    """The mean of an entry times exp(-2 pi i n t / T) over a period T, for n turns."""
    if callable(entry) or plan_of(orbit.scene.field, len(orbit.y0)).size:
        return _integral_at_corners(orbit, entry, turns) / orbit.period
    y, *_ = _along(orbit, entry, _times(orbit))
    n = len(y) - 1
    # Exact to rounding for a smooth periodic function.
    return complex(np.mean(y[:-1] * np.exp(-2j * np.pi * turns * np.arange(n) / n)))


def _integral_at_corners(orbit: Orbit, entry: Output, turns: int) -> complex:
    """The integral of an entry times exp(-2 pi i n t / T) over a period T, where forces jump.

    Between two samples a polynomial of degree 5 is integrated. Each round samples again those parts
    of the last one in which a corner makes this wrong.
    """
    speed = -2j * np.pi * turns / orbit.period
    ts, total, before, counted = _times(orbit), 0.0j, np.inf, np.ones(_SAMPLES, bool)
    while True:
        y, slopes, curvatures = _along(orbit, entry, ts)
        turn = np.exp(speed * ts)
        curvatures = turn * (curvatures + 2 * speed * slopes + speed**2 * y)
        slopes, y = turn * (slopes + speed * y), turn * y
        parts, off = _integrate_parts(np.diff(ts), y, slopes, curvatures)
        off = np.where(counted, off, 0.0)
        rounding = np.finfo(float).eps * orbit.period * np.abs(y).max()
        worst = np.sort(np.argsort(off)[-_MOST_PARTS:])
        near = worst[off[worst] > rounding / _MOST_PARTS]
        error = off[near].sum()
        if error <= rounding or error > 0.5 * before:
            return complex(total + parts[counted].sum())
        before = error
        counted[near] = False
        total += parts[counted].sum()
        ts, counted = _within(ts, near)


def _integrate_parts(
    h: np.ndarray, y: np.ndarray, slopes: np.ndarray, curvatures: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) integrals between samples h (n,) apart, and estimates of their errors at corners."""
    rise, tilt, bend = np.diff(y), -np.diff(slopes), curvatures[1:] + curvatures[:-1]
    level, ends = y[1:] + y[:-1], slopes[1:] + slopes[:-1]
    fine = h * (level / 2 + h * (tilt / 10 + h * bend / 120))
    # The cubic errs at a corner by another amount than the polynomial of degree 5, so that their
    # difference shows it; a jump of the value is shown by `jump`.
    cubic = h * (level / 2 + h * tilt / 12)
    jump = h * (rise - h * (ends / 2 - h * np.diff(curvatures) / 12))
    return fine, np.abs(fine - cubic) + np.abs(jump)


def _within(ts: np.ndarray, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """New samples within some of the parts between times ts, and which of the new parts count."""
    n = _SAMPLES // len(parts)
    inside = np.linspace(ts[parts], ts[parts + 1], n, axis=1).ravel()
    new = np.append(inside, np.full(_SAMPLES + 1 - len(inside), inside[-1]))
    # The other new parts lie between two of the old ones, or have no length.
    return new, (np.arange(_SAMPLES) % n < n - 1) & (np.arange(_SAMPLES) < len(inside))


_OF_ORBITS: dict[str, Quantity] = {
    "period": lambda orbit: orbit.period,
    "energy": lambda orbit: float(energy(orbit.scene, 0.0, orbit.y0)),
    "jacobi": lambda orbit: float(jacobi_constant(orbit.scene, orbit.y0)),
    "multiplier": lambda orbit: float(np.abs(stability(orbit).nontrivial).max(initial=0.0)),
}
_OF_ENTRIES: dict[str, Callable[[Orbit, Output], float]] = {
    "max": lambda orbit, entry: extremes(orbit, entry)[1],
    "min": lambda orbit, entry: extremes(orbit, entry)[0],
    "amplitude": amplitude,
    "mean": mean,
    "phase": phase,
}


def quantity(what: str | Quantity) -> Quantity:
    """The function of an orbit that a name stands for.

    Args:
      what: a function from an orbit to a number, or a name; see above.
    Raises:
      ValueError: `what` is neither.
    """
    if callable(what):
        return what
    wanted = f"a function of an orbit, or a name: {', '.join(_OF_ORBITS)} or amplitude x"
    if not isinstance(what, str):
        raise fail("quantity", wanted, repr(what))
    if what in _OF_ORBITS:
        return _OF_ORBITS[what]
    word, _, entry = what.partition(" ")
    if word not in _OF_ENTRIES or not entry:
        names = ", ".join(f"{word} NAME" for word in _OF_ENTRIES)
        raise fail("quantity", wanted, repr(what), f"Of entries there are {names}.")
    return lambda orbit: _OF_ENTRIES[word](orbit, entry)


def check_quantity(what: str | Quantity, scene: Scene) -> None:
    """Raise ValueError, before a family is computed, unless a scene's orbits have a quantity."""
    quantity(what)
    word, _, entry = what.partition(" ") if isinstance(what, str) else ("", "", "")
    if word in _OF_ENTRIES:
        choice("entry", entry, [name for name, _ in scene.labels()])
    elif word == "jacobi":
        restricted(scene)
    elif word == "energy" and not scene.has_energy:
        raise fail("quantity", "one of a scene without an energy", "energy")


def label(what: str | Quantity) -> str:
    """What a quantity is called: its name, or that of the function; "quantity" if it has none."""
    return what if isinstance(what, str) else name_of(what, "quantity")


def unit(what: str, scene: Scene) -> str:
    """The unit of a named quantity in a scene; "1" where it has none or the name is unknown."""
    labels = scene.labels()
    known = {"period": second(labels) or "1", "energy": scene.in_units("J") or "1"}
    word, _, entry = what.partition(" ")
    if word == "phase":
        return "rad"
    return known[what] if what in known else dict(labels).get(entry, "1")


def _times(orbit: Orbit) -> np.ndarray:
    """(n,) times of samples of a period, evenly spaced."""
    return np.linspace(0.0, orbit.period, _SAMPLES + 1)


def _along(
    orbit: Orbit, entry: Output, ts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n,) an entry and its first two derivatives at some times (n,) of a period."""
    scene = orbit.scene
    motion = simulate(scene, samples=ts, rtol=orbit.rtol, solver=orbit.solver)
    if callable(entry):
        y, slopes, curvatures = map(np.asarray, _derivatives(scene, motion.ts, motion.ys, of=entry))
        if y.ndim > 1:
            raise fail("entry", "a function that returns ()", f"one that returns {y.shape[1:]}")
        return y, slopes, curvatures
    # One program for all entries.
    names = [name for name, _ in scene.labels()]
    i = names.index(choice("entry", entry, names))
    y, slopes, curvatures = (np.asarray(x)[:, i] for x in _derivatives(scene, motion.ts, motion.ys))
    return y, slopes, curvatures


def _state(t: Array, y: Array) -> Array:
    del t
    return y


@functools.partial(jax.jit, static_argnames="of")
def _derivatives(
    scene: Scene, ts: Array, ys: Array, *, of: Callable[[Array, Array], Array] = _state
) -> tuple[Array, Array, Array]:
    """(n, ...) a function of time and state, and its first and second derivative along a motion."""

    def along(function: Callable[[Array, Array], Array]) -> Callable[[Array, Array], Array]:
        def slope(t: Array, y: Array) -> Array:
            return jax.jvp(function, (t, y), (jnp.ones(()), scene.rate(t, y)))[1]

        return slope

    first = along(of)
    second = along(first)
    values, slopes, curvatures = (jax.vmap(x)(ts, ys) for x in (of, first, second))
    return values, slopes, curvatures
