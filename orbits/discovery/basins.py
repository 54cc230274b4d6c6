"""Basins of attraction: to which attractor each start of a grid goes.

All starts run on the ensemble engine. Where motions end, attractors are sought and verified: an
equilibrium by Newton's method and its eigenvalues, a periodic orbit by `orbits.find` and its
multipliers, a chaotic attractor by a positive Lyapunov exponent. A motion belongs to the attractor
that it has come close to; one that is near none runs on, and in the end is said to go nowhere. A
driven scene is looked at once in each period of its drive.
"""

import dataclasses
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
from scipy.spatial import cKDTree

import jaxdyn
from jaxdyn import Scene, _checks, _text
from jaxdyn._records.kinds import check_first
from jaxdyn.analysis.equilibria import equilibrium
from jaxdyn.chaos.lyapunov import lyapunov_exponents
from jaxdyn.ensemble import engine
from jaxdyn.files import archives
from jaxdyn.scales import groups
from orbits.analysis.stability import stability
from orbits.closing.given import drive_period, driven
from orbits.orbit import Orbit
from orbits.shooting.finding import find

_RTOL = 1e-8
#: Of the sizes of the entries: how near a motion is that has reached an attractor.
_REACHED = 1e-3
_NEWTON = 0.05  # how near an equilibrium is that may be where a motion ends
_RETURNED = 0.03  # and how near a return that may be a period
_SAMPLES = 4000  # of a motion in which returns are sought, and of an orbit
_PERIODS = 16  # of the drive: the longest orbit that is sought
_CLOUD = 20_000  # points of a chaotic attractor
_CLOUD_SPACING = 4.0  # of the largest gaps in it: how near a motion on it is
_LARGER = 2.0  # than its first half: the second half of a motion that has no bound
_EXPONENT_SPANS = 10.0  # spans of the exponents of a chaotic motion
_SIZED = 8  # motions whose extent says how large entries are
_TRIES = 6  # ends of a round from which no attractor was found
_CHUNK = 65_536  # starts between two writings of the file
_SD = 1.96  # standard deviations of a 95 % interval
_FORMAT = "basins.json"
_REMEDY = "Give another path, or delete the file."

EQUILIBRIUM, ORBIT, CHAOTIC = "equilibrium", "orbit", "chaotic"


class Attractor(NamedTuple):
    """Where motions go.

    Attributes:
      kind: "equilibrium", "orbit" or "chaotic".
      points: (p, k) the equilibrium; an orbit, once in each period of a drive if there is one; a
        cloud of points on a chaotic attractor.
      orbit: of an orbit.
      exponents: (e,) eigenvalues' real parts, Floquet exponents or Lyapunov exponents.
      bars: (e,) of these.
    """

    kind: str
    points: np.ndarray
    orbit: Orbit | None
    exponents: np.ndarray
    bars: np.ndarray

    @property
    def said(self) -> str:
        """The attractor in words."""
        numbers = ", ".join(f"{x:.3g}" for x in self.points[0])
        if self.kind == ORBIT:
            assert self.orbit is not None
            return f"stable orbit of period {self.orbit.period:.6g} through ({numbers})"
        if self.kind == EQUILIBRIUM:
            return f"stable equilibrium at ({numbers})"
        return f"chaotic attractor, exponent {self.exponents[0]:.3g} +- {self.bars[0]:.1g}"


@dataclasses.dataclass(frozen=True)
class Basins:
    """To which attractor each start goes.

    Attributes:
      scene: of the motions.
      names: of the varied entries of the start, one for each axis.
      axes: their values.
      labels: (n1, n2, ...) number of the attractor of each start; -1 where none was reached in the
        time, or the motion stopped.
      attractors: the attractors.
      time: how long the longest motions ran.
      computed: how many motions ran; fewer than there are labels where the boundary was refined.
      fractions: (a + 1,) shares of the starts of the grid as given; the last of those that reach
        none.
      bars: (a + 1,) half-widths of their 95 % intervals, as of starts drawn at random.
    """

    scene: Scene
    names: tuple[str, ...]
    axes: tuple[np.ndarray, ...]
    labels: np.ndarray
    attractors: tuple[Attractor, ...]
    time: float
    computed: int
    fractions: np.ndarray
    bars: np.ndarray

    @_text.never_raising
    def __repr__(self) -> str:
        rows = []
        said = [*(f"{i}: {a.said}" for i, a in enumerate(self.attractors)), "none"]
        for text, share, bar in zip(said, self.fractions, self.bars, strict=True):
            rows.append((f"{100 * share:.2f} +- {100 * bar:.2f} %", text))
        shape = " x ".join(map(str, self.labels.shape))
        head = f"Basins of {_text.title_of(self.scene)}, {shape} starts in {', '.join(self.names)}"
        return _text.table(head, rows)

    _repr_html_ = _text.html

    def plot(self, path=None, *, title: str | None = None):
        """A picture of the basins and of the attractors; see `orbits.drawing.basins`."""
        from orbits.drawing import basin_maps

        return basin_maps.basins(self, path, title=title)


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
    progress: bool = False,
) -> Basins:
    """The basins of attraction of a scene over a grid of starts.

    Args:
      scene: with the entries of the start that do not vary.
      grid: values of entries of the start by name, an array (n,) for each; all combinations run.
      t1: () time of a round; the scene's own span by default. Of a driven scene it is lengthened
        to whole periods.
      rounds: how often motions that have reached no attractor go on for that time.
      refine: how often a grid of two entries is made twice as fine. Only starts between different
        labels run then; others have that of their neighbours.
      period: of the drive, where it cannot be read from the rate.
      rtol: relative tolerance of a step.
      path: .npz file of the first round's ends, by which an interrupted call goes on.
      progress: show a bar.
    Returns:
      Labels, verified attractors, fractions with bars.
    Raises:
      ValueError: a name is no entry of the state, values are no finite numbers, a number is out of
        range, the drive's period is unknown, or the file belongs to another call.
    Limits: attractors that no start of the grid reaches are not seen. That a motion stays with the
      attractor it has come near is not proved. Quasi-periodic attractors are not recognised: such
      motions reach none.
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
    names = tuple(grid) if isinstance(grid, Mapping) else ()
    if not names:
        remedy = 'For example {"x": np.linspace(-1, 1, 100)}.'
        raise _checks.fail("grid", "values of entries by name", repr(grid)[:60], remedy)
    labels = [name for name, _ in scene.labels()]
    entries = [labels.index(_checks.choice("grid", name, labels)) for name in names]
    axes = tuple(np.asarray(_checks.host_array(name, x, (None,))) for name, x in grid.items())
    for name, values in zip(names, axes, strict=True):
        if not len(values):
            raise _checks.fail(name, "at least one value", "none")
    _checks.whole("rounds", rounds)
    _checks.whole("refine", refine, 0, 10)
    if refine and len(axes) != 2:
        raise _checks.fail("refine", "a grid of two entries", len(axes), "Leave it out.")
    span = float(_checks.positive("t1", scene.t1 if t1 is None else t1))
    turn = _period(scene, period)
    span = span if turn is None else turn * np.ceil(span / turn * (1 - 1e-12))
    settling = _Settling(scene, span, turn, rounds, rtol, progress)

    def starts(*values: np.ndarray) -> np.ndarray:
        y0s = np.tile(np.asarray(scene.y0), (values[0].size, 1))
        for entry, x in zip(entries, values, strict=True):
            y0s[:, entry] = x.ravel()
        return y0s

    first = starts(*np.meshgrid(*axes, indexing="ij"))
    found = settling.labels(first, path).reshape([len(x) for x in axes])
    counts = [np.mean(found == i) for i in range(len(settling.attractors))]
    fractions = np.array([*counts, np.mean(found < 0)])
    for _ in range(refine):
        axes, found = _refine(axes, found, settling, starts)
    return Basins(
        scene=scene,
        names=names,
        axes=axes,
        labels=found,
        attractors=tuple(settling.attractors),
        time=settling.longest,
        computed=settling.computed,
        fractions=np.append(fractions, np.zeros(0)),
        bars=_SD * np.sqrt(fractions * (1 - fractions) / len(first)),
    )


def _period(scene: Scene, period: float | None) -> float | None:
    """The period of the drive; None for an autonomous scene."""
    if not driven(scene):
        return None
    found = drive_period(scene) if period is None else float(_checks.positive("period", period))
    if found is None:
        raise _checks.fail("period", "that of the drive", "none that can be read", "Pass period=.")
    return found


def _refine(axes, labels: np.ndarray, settling: "_Settling", starts):
    """Axes and labels with a value between every two; only starts at a boundary run."""
    axes = tuple(np.sort(np.append(x, (x[1:] + x[:-1]) / 2)) if len(x) > 1 else x for x in axes)
    coarse = [np.arange(len(x)) / 2 for x in axes]
    low = np.ix_(*(np.floor(x).astype(int) for x in coarse))
    high = np.ix_(*(np.ceil(x).astype(int) for x in coarse))
    corners = [labels[low], labels[high]]
    corners += [labels[low[0], high[1]], labels[high[0], low[1]]]
    fine = corners[0].copy()
    differ = np.any([corner != fine for corner in corners[1:]], axis=0)
    new = differ & ~np.logical_and.outer(coarse[0] % 1 == 0, coarse[1] % 1 == 0)
    if new.any():
        values = np.meshgrid(*axes, indexing="ij")
        fine[new] = settling.labels(starts(*(x[new] for x in values)))
    return axes, fine


class _Settling:
    """Motions that run until they are near an attractor, and the attractors found so far."""

    def __init__(self, scene, span, turn, rounds, rtol, progress):
        self.scene, self.span, self.turn, self.rounds = scene, span, turn, rounds
        self.rtol, self.progress = rtol, progress
        self.attractors: list[Attractor] = []
        self.longest, self.computed = 0.0, 0
        self.sizes = np.ones(len(scene.y0))

    def labels(self, y0s: np.ndarray, path=None) -> np.ndarray:
        """(n,) number of the attractor of each start."""
        self.computed += len(y0s)
        found = np.full(len(y0s), -1)
        ends = self._ends(y0s) if path is None else self._run_resumably(y0s, path)
        if not self.attractors:
            self.sizes = self._sizes(y0s[np.isfinite(ends).all(axis=1)])
        for number in range(1, self.rounds + 1):
            self.longest = max(self.longest, number * self.span)
            last = number == self.rounds
            self._match(ends, found, last)
            self._discover(ends, found, last)
            open_ = (found < 0) & np.isfinite(ends).all(axis=1)
            if last or not open_.any():
                break
            ends[open_] = self._ends(ends[open_])
        return found

    def _sizes(self, y0s: np.ndarray) -> np.ndarray:
        """(k,) largest entries of some motions: what rests in the end has moved before."""
        some = y0s[:: max(len(y0s) // _SIZED, 1)]
        scenes = (self.scene.starting(y, self.span) for y in some)
        motions = [jaxdyn.simulate(scene, throw=False).ys for scene in scenes]
        largest = np.nanmax(np.abs(np.concatenate([np.zeros((1, y0s.shape[1])), *motions])), axis=0)
        sizes = np.asarray(groups(self.scene.system).sizes(largest))
        return np.where(sizes > 0, sizes, 1.0)

    def _ends(self, y0s: np.ndarray) -> np.ndarray:
        done = engine.run(self.scene, y0s, self.span, rtol=self.rtol, progress=self.progress)
        return np.where(np.asarray(done.ok)[:, None], done.y1, np.nan)

    def _run_resumably(self, y0s: np.ndarray, path) -> np.ndarray:
        """The ends of the first round, of which those in a file do not run again."""
        numbers = [np.asarray(x) for x in jax.tree.leaves(self.scene)]
        parts = [y0s, np.array([self.span, self.rtol]), *numbers]
        digest = hashlib.sha256(b"".join(np.ascontiguousarray(x).tobytes() for x in parts))
        record = {"format": "basins", "of": digest.hexdigest()}
        ends = np.empty((0, y0s.shape[1]))
        if Path(path).exists():
            read = archives.read(path, _FORMAT, _REMEDY)
            if read.record != record:
                raise _checks.fail("path", "the file of this call", f"{path}, of another", _REMEDY)
            ends = read.arrays["ends"]
        while len(ends) < len(y0s):
            ends = np.concatenate([ends, self._ends(y0s[len(ends) : len(ends) + _CHUNK])])
            archives.write(path, _FORMAT, record, {"ends": ends})
        return ends.copy()

    def _apart(self, ys: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) largest entry of the difference of states from one, relative to sizes."""
        difference = jax.vmap(self.scene.system.difference, (0, None))(ys, y)
        return np.abs(np.asarray(difference) / self.sizes[None]).max(axis=1)

    def _match(self, ends: np.ndarray, found: np.ndarray, last: bool, only=None) -> None:
        """Label the ends that are near an attractor; near a chaotic one in the last round only."""
        for i, attractor in enumerate(self.attractors):
            if (only is not None and i != only) or (attractor.kind == CHAOTIC and not last):
                continue
            open_ = np.flatnonzero((found < 0) & np.isfinite(ends).all(axis=1))
            if len(open_):
                near = self._distance(attractor, ends[open_])
                found[open_[near]] = i

    def _distance(self, attractor: Attractor, ys: np.ndarray) -> np.ndarray:
        """(n,) whether states are near an attractor."""
        points = self._wrap(attractor.points) / self.sizes
        places = self._wrap(ys) / self.sizes
        tree = cKDTree(points)
        distance, nearest = tree.query(places, p=np.inf)
        if attractor.kind == CHAOTIC:
            gaps = tree.query(points, k=2, p=np.inf)[0][:, 1]
            return distance < _CLOUD_SPACING * np.quantile(gaps, 0.999)
        if attractor.kind == ORBIT and self.turn is None:
            for side in (-1, 1):  # between samples an orbit is nearly straight
                other = points[(nearest + side) % len(points)]
                along = other - points[nearest]
                length = np.maximum(np.sum(along**2, axis=1), np.finfo(float).tiny)
                share = np.sum((places - points[nearest]) * along, axis=1) / length
                foot = points[nearest] + np.clip(share, 0, 1)[:, None] * along
                distance = np.minimum(distance, np.abs(places - foot).max(axis=1))
        return distance < _REACHED

    def _wrap(self, ys: np.ndarray) -> np.ndarray:
        """States with angles within half a turn of those of the start."""
        y0 = np.asarray(self.scene.y0)
        return y0 + np.asarray(jax.vmap(self.scene.system.difference, (0, None))(ys, y0))

    def _discover(self, ends: np.ndarray, found: np.ndarray, last: bool) -> None:
        """Seek attractors where motions that are near none have ended."""
        tried = np.zeros(len(ends), bool)
        failed = 0
        while failed < _TRIES:
            open_ = np.flatnonzero((found < 0) & ~tried & np.isfinite(ends).all(axis=1))
            if not len(open_):
                return
            one = open_[0]
            tried[one] = True
            new = self._attractor(ends[one], last)
            if new is None:
                failed += 1
                continue
            self.attractors.append(new)
            self._match(ends, found, last, only=len(self.attractors) - 1)
            if found[one] < 0:
                failed += 1

    def _attractor(self, y: np.ndarray, last: bool) -> Attractor | None:
        scene = self.scene.starting(y, self.span)
        if self.turn is None:
            rest = np.asarray(equilibrium(scene, y))
            if np.isfinite(rest).all() and self._apart(rest[None], y)[0] < _NEWTON:
                known = [a.points for a in self.attractors if a.kind == EQUILIBRIUM]
                if any(self._apart(points, rest)[0] < _REACHED for points in known):
                    return None  # it is on its way
                near = jaxdyn.linearize(scene, rest)
                if near.verdict == "stable":
                    real = np.asarray(near.eigenvalues).real
                    return Attractor(EQUILIBRIUM, rest[None], None, real, np.asarray(near.bars))
        guess = self._return_time(scene, y)
        if guess is not None:
            orbit = find(scene, y, guess, throw=False)
            if orbit.ok and self._apart(np.asarray(orbit.y0)[None], y)[0] < _NEWTON:
                orbits = [a for a in self.attractors if a.kind == ORBIT]
                if any(self._distance(a, np.asarray(orbit.y0)[None])[0] for a in orbits):
                    return None  # it is on its way
                known = stability(orbit)
                size = np.abs(np.asarray(known.nontrivial))
                if (size + np.asarray(known.bars) < 1).all():  # not only stable: it attracts
                    return self._of_orbit(orbit, size, np.asarray(known.bars))
        return self._chaotic(scene) if last else None

    def _of_orbit(self, orbit: Orbit, multipliers: np.ndarray, bars: np.ndarray) -> Attractor:
        period = float(orbit.period)
        count = _SAMPLES if self.turn is None else max(round(period / self.turn), 1)
        ts = np.arange(count) / count * period
        points = np.asarray(orbit.y0)[None]
        if count > 1:
            one = self.scene.starting(orbit.y0, period)
            points = np.asarray(jaxdyn.simulate(one, period, samples=ts).ys)
        size = np.maximum(multipliers, np.finfo(float).tiny)
        exponents = np.log(size) / period
        return Attractor(ORBIT, points, orbit, exponents, bars / size / period)

    def _return_time(self, scene: Scene, y: np.ndarray) -> float | None:
        """The time after which a motion first comes back, if it does."""
        if self.turn is not None:
            ts = self.turn * np.arange(1, _PERIODS + 1)
            motion = jaxdyn.simulate(scene, ts[-1], samples=ts, throw=False)
            back = np.flatnonzero(self._apart(np.asarray(motion.ys), y) < _REACHED)
            return float(ts[back[0]]) if len(back) else None
        ts = np.linspace(0.0, self.span, _SAMPLES)
        motion = jaxdyn.simulate(scene, self.span, samples=ts, throw=False)
        apart = self._apart(np.asarray(motion.ys), y)
        gone = np.flatnonzero(apart > 2 * _RETURNED)
        if not len(gone):
            return None
        least = (apart[1:-1] <= apart[:-2]) & (apart[1:-1] <= apart[2:])
        back = 1 + np.flatnonzero(least & (apart[1:-1] < _RETURNED))
        back = back[back > gone[0]]
        return float(ts[back[0]]) if len(back) else None

    def _chaotic(self, scene: Scene) -> Attractor | None:
        found = lyapunov_exponents(scene, _EXPONENT_SPANS * self.span, throw=False)
        exponents, bars = np.asarray(found.exponents), np.asarray(found.bars)
        if not exponents[0] - bars[0] > 0:
            return None
        if self.turn is None:
            time = _EXPONENT_SPANS * self.span
            ts = np.linspace(0.0, time, _CLOUD)
        else:
            ts = self.turn * np.arange(_CLOUD // 4)
        points = np.asarray(jaxdyn.simulate(scene, ts[-1], samples=ts, max_steps=10**8).ys)
        early, late = np.array_split(np.abs(points), 2)
        if (late.max(axis=0) > _LARGER * early.max(axis=0)).any():
            return None  # tangents grow also where the motion does
        return Attractor(CHAOTIC, points, None, exponents, bars)
