"""A torus near a circle: the conditions that single it out, and as many modes as it needs."""

import dataclasses
import math

import jax
import numpy as np

from jaxdyn import Scene
from orbits.tori import circle
from orbits.tori.invariance import Conditions, Unknowns, error, mean_energy, solve
from orbits.tori.record import Torus, TorusOutcome

_MORE = 1.5  # factor of the modes from attempt to attempt
_COLLAPSED = 0.02  # share of the first amplitude below which a circle has become a point


def refined(
    like: Torus,
    start: Unknowns,
    w: np.ndarray,
    target: tuple,
    *,
    goal: float,
    max_modes: int,
) -> Torus:
    """The torus near a start, with as many modes as it needs.

    Args:
      like: a torus of the same family, for what they share.
      start: the first circle.
      w: (k,) complex direction of the first harmonic, which fixes the origin of theta.
      target: ("amplitude", a), ("rotation", rho), or ("along", tangent, start) for a step of
        continuation, whose tangent is an `Unknowns` with as many points as the start.
      goal: largest error of invariance.
      max_modes: largest number of modes.
    """
    now = start
    while True:
        conditions = _conditions(like, now, start, w, target)
        done = solve(like.scene, now, conditions, like.rtol)
        found = _torus(like, done.unknowns)
        if not np.isfinite(done.residual):
            return dataclasses.replace(found, outcome=TorusOutcome.MOTION_ENDS)
        off = error(like.scene, done.unknowns, like.rtol)
        found = dataclasses.replace(found, error=off, outcome=TorusOutcome.NO_CONVERGENCE)
        if found.amplitude < _COLLAPSED * np.linalg.norm(circle.harmonic(start.points)):
            return dataclasses.replace(found, outcome=TorusOutcome.COLLAPSED)
        if off <= goal:
            return dataclasses.replace(found, outcome=TorusOutcome.FOUND)
        modes = len(now.points) // 2
        if done.residual > max(goal, off):
            return found
        if modes == max_modes or not np.isfinite(off):
            return dataclasses.replace(found, outcome=TorusOutcome.NOT_SMOOTH)
        now = done.unknowns.resampled(2 * min(math.ceil(_MORE * modes), max_modes) + 1)


def _torus(like: Torus, found: Unknowns) -> Torus:
    level = mean_energy(like.scene, found.points)[0] if like.scene.has_energy else math.nan
    size = float(np.linalg.norm(circle.harmonic(found.points)))
    return dataclasses.replace(
        like,
        points=found.points,
        time=found.time,
        rotation=found.rotation,
        amplitude=size,
        energy=like.energy if like.held == "energy" else level,
    )


def _conditions(
    like: Torus, now: Unknowns, start: Unknowns, w: np.ndarray, target: tuple
) -> Conditions:
    """The rows for a circle of as many points as `now`."""
    n, k = now.points.shape
    nothing = np.zeros(n * k)
    # The first harmonic along w: its imaginary part fixes theta = 0, its real part the amplitude.
    wave = 2 / n * np.exp(-1j * circle.angles(n))[:, None] * w.conj()[None]
    phase, size = wave.imag.ravel(), wave.real.ravel()
    rows, values = [np.append(phase, [0.0, 0.0])], [0.0]
    if target[0] == "amplitude":
        rows, values = [*rows, np.append(size, [0.0, 0.0])], [*values, target[1]]
    elif target[0] == "rotation":
        rows, values = [*rows, np.append(nothing, [1.0, 0.0])], [*values, target[1]]
    else:
        along = packed_covector(target[1].resampled(n))
        rows, values = [*rows, along], [*values, along @ start.resampled(n).packed()]
    if like.held == "drive":
        rows, values = [*rows, np.append(nothing, [0.0, 1.0])], [*values, now.time]
    else:
        # Not moved along the flow.
        reference = start.resampled(n).points
        flow = np.asarray(_rates(like.scene, reference))
        flow = flow.ravel() / (n * max(np.abs(flow).max(), np.finfo(float).tiny))
        rows = [*rows, np.append(flow, [0.0, 0.0])]
        values = [*values, flow @ reference.ravel()]
    if like.held == "time":
        rows, values = [*rows, np.append(nothing, [0.0, 1.0])], [*values, like.time]
    level = like.energy if like.held == "energy" else None
    return Conditions(np.array(rows), np.array(values), level)


def packed_covector(tangent: Unknowns) -> np.ndarray:
    """(N k + 2,) the product with a tangent, with points weighted by their number."""
    points, rotation, time = tangent
    return np.concatenate([points.ravel() / len(points), [rotation, time]])


@jax.jit
def _rates(scene: Scene, points):
    return jax.vmap(lambda y: scene.rate(0.0, y))(points)
