"""Alignment of two orbits of free points, in time and in space.

Samples of both over a period are compared by quantities that are invariant under rotation,
reflection, scaling and relabelling, which gives the shift in time; the rotation is then found by
least squares.
"""

import dataclasses
import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn._checks import fail
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Scene
from orbits.motion import gravitates, quick_solve
from orbits.orbit import Orbit

#: Largest distance between two orbits that count as the same one, relative to their size.
TOLERANCE = 1e-6
SAMPLES = 2048  # samples of one period
_ROUNDS = 6  # Gauss-Newton steps on the shift in time
_DIFFERENCE = 1e-7  # share of the period over which a slope in time is taken
_CANDIDATES = 8  # number of shifts that are refined
_MOST_POINTS = 6  # most bodies, which already have 720 orders


@dataclasses.dataclass(frozen=True)
class Match:
    """The transformation between two orbits.

    Attributes:
      distance: largest distance of the aligned orbits, relative to their size.
      shift: the delay of the second orbit.
      backwards: whether the second orbit is reversed in time.
      order: the bodies of the second orbit that correspond to those of the first, in their order;
        () where there are none.
      mirrored: whether the second orbit is a mirror image.
      scale: lengths of the second orbit over those of the first.
    """

    distance: float
    shift: float
    backwards: bool
    order: tuple[int, ...]
    mirrored: bool
    scale: float


def match_points(a: Orbit, b: Orbit) -> Match | None:
    """The best alignment of the second orbit of free points; None if there is none."""
    first, second = (orbit.scene.system for orbit in (a, b))
    assert isinstance(first, FreePoints)
    assert isinstance(second, FreePoints)
    if first.d != second.d or len(first.m) != len(second.m):
        return None
    n = len(first.m)
    if n > _MOST_POINTS:
        raise fail("orbit", f"at most {_MOST_POINTS} bodies", n)
    scale = _scale(a, b)
    if scale is None:
        return None
    masses = np.asarray(first.m), np.asarray(second.m)
    here = centre(samples(a), masses[0])
    best: Match | None = None
    for backwards in (False, True):
        units = _Units(lengths=1 / scale, slow=b.period / a.period, backwards=backwards)
        there = units.of(centre(samples(b), masses[1]))
        for index in _shifts(here, there, masses):
            shift = _refine(b, here, index, units, masses)
            there_late = units.of(centre(samples(b, shift), masses[1]))
            for order in _orders(*masses):
                distance, mirrored = distance_after_rotation(here, there_late[:, :, order])
                if best is None or distance < best.distance:
                    best = Match(
                        distance=distance,
                        shift=shift,
                        backwards=backwards,
                        order=order,
                        mirrored=mirrored,
                        scale=scale,
                    )
    return best


def _scale(a: Orbit, b: Orbit) -> float | None:
    """Lengths of the second orbit over those of the first; None if their periods do not fit."""
    if gravitates(a.scene) and gravitates(b.scene):
        strengths = (float(o.scene.effects[0].G * o.scene.system.m.sum()) for o in (a, b))
        one, two = strengths
        return float((b.period / a.period) ** (2 / 3) * (two / one) ** (1 / 3))
    return 1.0 if abs(a.period - b.period) <= TOLERANCE * a.period else None


def centre(ys: np.ndarray, m: np.ndarray) -> np.ndarray:
    """(s, 2, n, d) positions and velocities about the centre of mass."""
    x = ys.reshape(len(ys), 2, len(m), -1)
    return x - np.einsum("n,sand->sad", m / m.sum(), x)[:, :, None]


class _Units(NamedTuple):
    """Units, and a direction of time, in which the second orbit is compared with the first.

    Attributes:
      lengths: factor on the lengths of the second orbit.
      slow: its period over that of the first.
      backwards: whether it is run backwards.
    """

    lengths: float
    slow: float
    backwards: bool

    def of(self, x: np.ndarray) -> np.ndarray:
        """(s, 2, n, d) positions and velocities in these units."""
        x = x * np.array([self.lengths, self.lengths * self.slow])[:, None, None]
        if not self.backwards:
            return x
        x = np.roll(x[::-1], 1, axis=0)
        return x * np.array([1.0, -1.0])[:, None, None]


def _signature(x: np.ndarray, m: np.ndarray) -> np.ndarray:
    """(s, 3) invariants under rotation, reflection and relabelling, with mean 0 and size 1."""
    r, v = x[:, 0], x[:, 1]
    moments = np.stack(
        [
            np.einsum("n,snd,snd->s", m, r, r),
            np.einsum("n,snd,snd->s", m, r, v),
            np.einsum("i,j,sij->s", m, m, np.linalg.norm(r[:, :, None] - r[:, None], axis=-1)),
        ],
        axis=1,
    )
    moments = moments - moments.mean(axis=0)
    return moments / np.maximum(np.abs(moments).max(axis=0), 1e-300)


def _shifts(here: np.ndarray, there: np.ndarray, masses) -> list[int]:
    """The samples of the second orbit that fit the start of the first best."""
    a, b = _signature(here, masses[0]), _signature(there, masses[1])
    product = np.fft.rfft(a, axis=0).conj() * np.fft.rfft(b, axis=0)
    fit = np.fft.irfft(product, n=len(a), axis=0).sum(axis=1)
    peaks = np.flatnonzero((fit >= np.roll(fit, 1)) & (fit > np.roll(fit, -1)))
    best = peaks[np.argsort(-fit[peaks])][:_CANDIDATES]
    return [int(i) for i in best]


def _refine(b: Orbit, here, index: int, units: _Units, masses) -> float:
    """The time of the second orbit at which it fits the start of the first best."""
    m = masses[1]
    step = b.period / len(here)
    # The time of the sample with this index on the second orbit.
    shift = -index * step if units.backwards else index * step
    goal = _signature(here, masses[0])
    h = _DIFFERENCE * b.period

    def seen(ys):
        return _signature(units.of(centre(ys, m)), m)

    for _ in range(_ROUNDS):
        ys = samples(b, shift)
        rates = np.asarray(_rates(b.scene, ys))
        # Fourier interpolation would not do: in a close encounter there are too few samples.
        slope = (seen(ys + h * rates) - seen(ys - h * rates)) / (2 * h)
        move = float(np.sum((goal - seen(ys)) * slope) / np.sum(slope * slope))
        shift += move
        if abs(move) < 1e-13 * b.period:
            break
    return shift % b.period


@jax.jit
def _rates(scene: Scene, ys) -> jax.Array:
    return jax.vmap(lambda y: scene.rate(jnp.zeros(()), y))(ys)


def _orders(one: np.ndarray, two: np.ndarray):
    """All orders of the second orbit's bodies that match the masses of the first."""
    share, other = one / one.sum(), two / two.sum()
    for order in itertools.permutations(range(len(one))):
        if np.allclose(other[list(order)], share, rtol=1e-12):
            yield order


def distance_after_rotation(here: np.ndarray, there: np.ndarray) -> tuple[float, bool]:
    """Largest difference of states after the best rotation, and whether the rotation is improper.

    Positions and velocities are relative to their largest values.
    """
    d = here.shape[-1]
    sizes = [float(np.abs(here[:, i]).max()) for i in range(2)]
    p, q = (
        np.concatenate([x[:, i].reshape(-1, d) / sizes[i] for i in range(2)]) for x in (here, there)
    )
    u, _, vt = np.linalg.svd(q.T @ p)
    found = []
    for mirrored in (False, True):
        sign = np.sign(np.linalg.det(u @ vt)) * (-1.0 if mirrored else 1.0)
        turn = u @ np.diag([*[1.0] * (d - 1), sign]) @ vt
        found.append((float(np.abs(q @ turn - p).max()), mirrored))
    return min(found)


def samples(orbit: Orbit, shift: float = 0.0) -> np.ndarray:
    """(SAMPLES, k) states over one period from a given time."""
    scene = orbit.scene
    if shift:
        scene = scene.starting(quick_solve(scene, shift, rtol=orbit.rtol, solver=orbit.solver).y1)
    ts = np.arange(SAMPLES) * orbit.period / SAMPLES
    return np.asarray(
        quick_solve(scene, orbit.period, ts=ts, rtol=orbit.rtol, solver=orbit.solver).ys
    )
