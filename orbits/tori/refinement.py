"""The torus near a circle: the conditions that single it out, and the modes that it needs."""

import dataclasses
import math

import jax
import numpy as np

from jaxdyn import Scene
from orbits.tori import circle
from orbits.tori.invariance import Conditions, Metric, Unknowns, error, mean_energy, solve
from orbits.tori.record import Torus, TorusOutcome

_MORE = 1.5  # factor on the number of modes from attempt to attempt
_COLLAPSED = 0.02  # share of the first amplitude below which a circle has become a point


def refine(
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
      like: a torus of the same family, for what both share.
      start: the first circle.
      w: (k,) complex direction of the first harmonic, which fixes the origin of theta.
      target: ("amplitude", a), ("rotation", rho), or ("along", tangent, start, metric) for a step
        of continuation, whose tangent is an `Unknowns` with as many points as the start, and a unit
        vector in a `Metric`.
      goal: largest error of invariance, in the sizes of the entries.
      max_modes: largest number of modes.
    """
    now, metric = start, Metric.of(like.scene, start)
    least = _COLLAPSED * metric.norm(circle.harmonic(start.points))
    while True:
        conditions = _conditions(like, now, start, w, target, metric)
        done = solve(like.scene, now, conditions, like.rtol, metric)
        found = _torus(like, done.unknowns)
        if not np.isfinite(done.residual):
            return dataclasses.replace(found, outcome=TorusOutcome.MOTION_ENDS)
        off = error(like.scene, done.unknowns, like.rtol, metric)
        found = dataclasses.replace(found, error=off, outcome=TorusOutcome.NO_CONVERGENCE)
        if metric.norm(circle.harmonic(found.points)) < least:
            return dataclasses.replace(found, outcome=TorusOutcome.COLLAPSED)
        if off <= goal:
            return dataclasses.replace(found, outcome=TorusOutcome.FOUND)
        modes = len(now.points) // 2
        if done.residual > max(goal, off):
            return found
        if modes == max_modes or not np.isfinite(off):
            return dataclasses.replace(found, outcome=TorusOutcome.NOT_SMOOTH)
        now = done.unknowns.resample(2 * min(math.ceil(_MORE * modes), max_modes) + 1)


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
    like: Torus, now: Unknowns, start: Unknowns, w: np.ndarray, target: tuple, metric: Metric
) -> Conditions:
    """The rows for a circle of as many points as `now`."""
    n, k = now.points.shape
    nothing = np.zeros(n * k)
    # The first harmonic along w fixes theta = 0 by its imaginary, the amplitude by its real part.
    share = metric.norm(w)  # norm in the metric of a unit of the amplitude
    wave = 2 / n * np.exp(-1j * circle.angles(n))[:, None] * w.conj()[None] / metric.each**2 / share
    phase, size = wave.imag.ravel(), wave.real.ravel()
    duration = np.append(nothing, [0.0, 1 / metric.time])
    rows, values = [np.append(phase, [0.0, 0.0])], [0.0]
    if target[0] == "amplitude":
        rows, values = [*rows, np.append(size, [0.0, 0.0])], [*values, target[1] * share]
    elif target[0] == "rotation":
        rows, values = [*rows, np.append(nothing, [1.0, 0.0])], [*values, target[1]]
    else:
        _, tangent, _, lengths = target
        along = lengths.row(tangent.resample(n))
        rows, values = [*rows, along], [*values, along @ start.resample(n).pack()]
    if like.held == "drive":
        rows, values = [*rows, duration], [*values, now.time / metric.time]
    else:
        # The circle is not moved along the flow.
        reference = start.resample(n).points
        flow = np.asarray(_rates(like.scene, reference)) / metric.each
        flow = flow / (n * max(np.abs(flow).max(), np.finfo(float).tiny)) / metric.each
        rows = [*rows, np.append(flow.ravel(), [0.0, 0.0])]
        values = [*values, flow.ravel() @ reference.ravel()]
    if like.held == "time":
        rows, values = [*rows, duration], [*values, like.time / metric.time]
    level = like.energy if like.held == "energy" else None
    return Conditions(np.array(rows), np.array(values), level)


@jax.jit
def _rates(scene: Scene, points):
    return jax.vmap(lambda y: scene.rate(0.0, y))(points)
