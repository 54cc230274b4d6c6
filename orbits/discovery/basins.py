"""Basins of attraction: which attractor each start of a grid approaches.

All starts run on the ensemble engine. Attractors are searched for where motions end, and are
verified: an equilibrium by Newton's method and its eigenvalues, a periodic orbit by `orbits.find`
and its multipliers, a chaotic attractor by a positive Lyapunov exponent. A motion belongs to the
attractor that it has come close to; one that is not close to any continues, and belongs to none if
it does not reach one in time. A driven scene is sampled once in each period of its forcing.
"""

import functools
from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

import jaxdyn
from jaxdyn import Scene, _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.analysis.equilibria import equilibrium
from jaxdyn.chaos.lyapunov import lyapunov_exponents
from jaxdyn.ensemble import engine
from jaxdyn.files.rows import program_text, rows_in
from jaxdyn.scales import groups
from jaxdyn.system import differences
from orbits.analysis.same import minimal_period
from orbits.analysis.stability import stability
from orbits.closing.given import drive_period, is_driven
from orbits.discovery.settling import (
    CHAOTIC,
    CHUNK,
    CONTRACTS,
    EQUILIBRIUM,
    LAYOUT,
    NEWTON,
    ORBIT,
    REACHED,
    Attractor,
    Basins,
    Settling,
    as_axes,
    check_rounds,
    over_grid,
)
from orbits.discovery.workers import pack, unpack
from orbits.orbit import Orbit
from orbits.shooting.finding import find

_RTOL = 1e-8
#: Relative to the sizes of the entries: how close a return must be to be tried as a period.
_RETURNED = 0.03
_SAMPLES = 4000  # samples of a motion that is searched for returns, and of an orbit
_PERIODS = 16  # longest orbit that is searched for, in periods of the forcing
_CLOUD = 20_000  # points of a chaotic attractor
_LARGER = 2.0  # a motion whose second half is larger than its first by this factor is unbounded
_EXPONENT_SPANS = 10.0  # number of spans over which the exponents of a motion are computed
_SIZED = 8  # motions whose extent determines the sizes of the entries


@check_first
def basins(
    scene: Scene,
    grid: Mapping[str, Any],
    t1=None,
    *,
    rounds: int = 6,
    refine: int = 0,
    period: float | None = None,
    rtol: float = _RTOL,
    path: str | Path | None = None,
    executor: Executor | None = None,
    progress: bool = False,
) -> Basins:
    """The basins of attraction of a scene over a grid of starts.

    Args:
      scene: the scene; its start has the entries that do not vary.
      grid: values of entries of the start by name, an array (n,) for each; all combinations run.
      t1: () time of a round; the scene's own span by default. For a driven scene it is lengthened
        to a whole number of periods.
      rounds: largest number of rounds, of that time each, for motions that have not yet reached an
        attractor.
      refine: how often a grid of two entries is made twice as fine. Only new starts between
        different labels are run; others get the label of their neighbours.
      period: period of the forcing, if it cannot be read from the rate.
      rtol: relative tolerance of a step.
      path: file (.jsonl) to which the ends of motions are written as they are computed; the same
        call resumes from it where it was interrupted, with the same result.
      executor: runs the motions of a round, 16 384 at a time, in processes or, with Dask's, on
        several machines. It is sent the scene, whose functions must then be module-level. By
        default they run here, on all cores.
      progress: show a bar of the motions that run here.
    Returns:
      Labels, verified attractors, fractions with bars.
    Raises:
      ValueError: a name is not an entry of the state, values are not finite numbers, a number is
        out of range, the period of the forcing is unknown, or the file belongs to another call.
    Limits: attractors that no start of the grid reaches are not found. It is not proved that a
      motion stays with the attractor that it has come close to. Quasi-periodic attractors are not
      recognised: such motions get the label -1.
    Example:
      >>> import jaxdyn, orbits, numpy as np
      >>> def wells(t, y):
      ...     return [y[1], y[0] - y[0] ** 3 - 0.3 * y[1]]
      >>> scene = jaxdyn.ode(wells, [0.0, 0.0], 40.0, names=["x", "v"])
      >>> side = np.linspace(-1.95, 1.95, 20)
      >>> found = orbits.basins(scene, {"x": side, "v": side})
      >>> [a.kind for a in found.attractors], bool(abs(found.fractions[0] - 0.5) < 1e-9)
      (['equilibrium', 'equilibrium'], True)
    """
    _checks.check_on_host("basins", (scene, t1, period))
    labels = [name for name, _ in scene.labels()]
    axes = as_axes(grid, labels)
    check_rounds(rounds, refine, axes)
    span = float(_checks.positive("t1", scene.t1 if t1 is None else t1))
    forcing = _period(scene, period)
    span = span if forcing is None else forcing * np.ceil(span / forcing * (1 - 1e-12))
    entries = [labels.index(name) for name in axes]
    title, start = _text.title_of(scene), np.asarray(scene.y0)
    program = program_text(lambda scene, t, y: scene.rate(t, y), scene, 0.0, scene.y0)
    of = (program, scene, axes, entries, span, rounds, refine, rtol)
    with rows_in(path, LAYOUT, of, CHUNK, executor) as kept:
        motions = _Motions(scene, span, forcing, rounds, rtol, kept, progress)
        return over_grid(motions, axes, start, entries, refine, scene=scene, title=title)


def _period(scene: Scene, period: float | None) -> float | None:
    """The period of the forcing; None for an autonomous scene."""
    if not is_driven(scene):
        return None
    found = drive_period(scene) if period is None else float(_checks.positive("period", period))
    if found is None:
        raise _checks.fail("period", "that of the drive", "none that can be read", "Pass period=.")
    return found


def _states_after(scene: Scene, span, rtol: float, progress: bool, y0s: np.ndarray) -> np.ndarray:
    """(n, k) states at the end of a round from these starts; an executor may call this."""
    done = engine.run(unpack(scene), y0s, span, rtol=rtol, progress=progress)
    return np.where(np.asarray(done.ok)[:, None], done.y1, np.nan)


class _Motions(Settling):
    """The motions of a scene; for a driven one, the states once in each period of the forcing."""

    def __init__(self, scene, span, forcing, rounds, rtol, kept, progress):
        super().__init__(span, rounds, len(scene.y0), kept)
        self.scene, self.drive_period = scene, forcing
        self.rtol, self.progress = rtol, progress

    @property
    def is_curve(self):
        return self.drive_period is None

    @property
    def ends(self):
        given = pack(self.scene), float(self.span), self.rtol, self.progress
        return functools.partial(_states_after, *given)

    def largest(self, y0s):
        # From whole motions, since those that end at rest have moved before.
        some = y0s[:: max(len(y0s) // _SIZED, 1)]
        scenes = (self.scene.starting(y, self.span) for y in some)
        motions = [jaxdyn.simulate(scene, throw=False).ys for scene in scenes]
        largest = np.nanmax(np.abs(np.concatenate([np.zeros((1, y0s.shape[1])), *motions])), axis=0)
        sizes = np.asarray(groups(self.scene.system).sizes(largest))
        return np.where(sizes > 0, sizes, 1.0)

    def difference(self, ys, y):
        return np.asarray(differences(self.scene.system, ys, y))

    def wrap(self, ys):
        y0 = np.asarray(self.scene.y0)
        return y0 + self.difference(ys, y0)

    def attractor(self, y, last):
        scene = self.scene.starting(y, self.span)
        if self.drive_period is None:
            rest = np.asarray(equilibrium(scene, y))
            if np.isfinite(rest).all() and self.apart(rest[None], y)[0] < NEWTON:
                known = [a.points for a in self.attractors if a.kind == EQUILIBRIUM]
                if any(self.apart(points, rest)[0] < REACHED for points in known):
                    return None  # a known attractor that the motion still approaches
                near = jaxdyn.linearize(scene, rest)
                if near.verdict == "stable" and near.portrait != "centre":
                    real = np.asarray(near.eigenvalues).real
                    return Attractor(EQUILIBRIUM, rest[None], None, real, np.asarray(near.bars))
        guess = self._return_time(scene, y)
        if guess is not None:
            orbit = find(scene, y, guess, throw=False)
            # A motion that approaches slowly may return close enough only after several periods.
            if orbit.ok and (shortest := minimal_period(orbit))[1] > 1:
                orbit = find(scene, orbit.y0, shortest[0], throw=False)
            if orbit.ok and self.apart(np.asarray(orbit.y0)[None], y)[0] < NEWTON:
                orbits = [a for a in self.attractors if a.kind == ORBIT]
                if any(self.is_near(a, np.asarray(orbit.y0)[None])[0] for a in orbits):
                    return None  # a known attractor that the motion still approaches
                known = stability(orbit)
                size = np.abs(np.asarray(known.nontrivial))
                # Only the flow has a multiplier of 1: the orbit is not one of a family.
                alone = known.unit == (1 if self.drive_period is None else 0)
                if alone and (size + np.asarray(known.bars) < 1).all():
                    return self._of_orbit(orbit, size, np.asarray(known.bars))
        return self._chaotic(self.beside(y)) if last else None

    def _of_orbit(self, orbit: Orbit, multipliers: np.ndarray, bars: np.ndarray) -> Attractor:
        period = float(orbit.period)
        count = _SAMPLES if self.drive_period is None else max(round(period / self.drive_period), 1)
        ts = np.arange(count) / count * period
        points = np.asarray(orbit.y0)[None]
        if count > 1:
            one = self.scene.starting(orbit.y0, period)
            points = np.asarray(jaxdyn.simulate(one, period, samples=ts).ys)
        size = np.maximum(multipliers, np.finfo(float).tiny)
        exponents = np.log(size) / period
        return Attractor(ORBIT, points, orbit, exponents, bars / size / period)

    def _return_time(self, scene: Scene, y: np.ndarray) -> float | None:
        """The time after which a motion first returns; None if it does not."""
        if self.drive_period is not None:
            ts = self.drive_period * np.arange(1, _PERIODS + 1)
            motion = jaxdyn.simulate(scene, ts[-1], samples=ts, throw=False)
            back = np.flatnonzero(self.apart(np.asarray(motion.ys), y) < REACHED)
            return float(ts[back[0]]) if len(back) else None
        ts = np.linspace(0.0, self.span, _SAMPLES)
        motion = jaxdyn.simulate(scene, self.span, samples=ts, throw=False)
        apart = self.apart(np.asarray(motion.ys), y)
        gone = np.flatnonzero(apart > 2 * _RETURNED)
        if not len(gone):
            return None
        least = (apart[1:-1] <= apart[:-2]) & (apart[1:-1] <= apart[2:])
        back = 1 + np.flatnonzero(least & (apart[1:-1] < _RETURNED))
        back = back[back > gone[0]]
        return float(ts[back[0]]) if len(back) else None

    def _chaotic(self, y: np.ndarray) -> Attractor | None:
        start = self.scene.system.project(jnp.zeros(()), jnp.asarray(y))
        scene = self.scene.starting(start, self.span)
        found = lyapunov_exponents(scene, _EXPONENT_SPANS * self.span, throw=False)
        exponents, bars = np.asarray(found.exponents), np.asarray(found.bars)
        # Where volumes are preserved, nothing attracts.
        if not (exponents[0] - bars[0] > 0 and exponents.sum() < -CONTRACTS * exponents[0]):
            return None
        if self.drive_period is None:
            time = _EXPONENT_SPANS * self.span
            ts = np.linspace(0.0, time, _CLOUD)
        else:
            ts = self.drive_period * np.arange(_CLOUD // 4)
        points = np.asarray(jaxdyn.simulate(scene, ts[-1], samples=ts, max_steps=10**8).ys)
        early, late = np.array_split(np.abs(points), 2)
        if (late.max(axis=0) > _LARGER * early.max(axis=0)).any():
            return None  # tangents also grow if the motion itself does
        return Attractor(CHAOTIC, points, None, exponents, bars)
