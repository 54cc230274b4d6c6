"""Attractors, and the assignment of starts to them: common parts for flows and maps."""

import abc
import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from jaxdyn import Scene, _checks, _text
from jaxdyn.files.layout import Layout
from jaxdyn.files.rows import Rows
from orbits.orbit import Orbit

#: Relative to the sizes of the entries: the distance within which an attractor is reached.
REACHED = 1e-3
NEWTON = 0.05  # the distance within which Newton's method may find one from the end of a motion
#: Relative to the largest exponent: by how much the sum of the exponents of a chaotic attractor is
#: at least below 0.
CONTRACTS = 1e-6
#: The distance within which a chaotic attractor is reached, relative to the largest gaps between
#: its points.
_CLOUD_SPACING = 4.0
_SD = 1.96  # standard deviations of a 95 % interval

#: The file of the states in which motions end, and how many of them are in a line.
LAYOUT = Layout("jaxdyn-basins", 1, "orbits.basins or orbits.map_basins")
CHUNK = 16_384

EQUILIBRIUM, ORBIT, CHAOTIC = "equilibrium", "orbit", "chaotic"
FIXED, CYCLE = "fixed point", "cycle"  # for maps


class Attractor(NamedTuple):
    """An attractor.

    Attributes:
      kind: "equilibrium", "orbit" or "chaotic"; for a map "fixed point", "cycle" or "chaotic".
      points: (p, k) the equilibrium; points of the orbit, one for each period of a forcing if there
        is one; the cycle; a cloud of points on a chaotic attractor.
      orbit: the orbit, if it is one.
      exponents: (e,) real parts of eigenvalues, Floquet exponents or Lyapunov exponents; for a map
        those of one step.
      bars: (e,) their error bars.
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
        if self.kind in (EQUILIBRIUM, FIXED):
            return f"stable {self.kind} at ({numbers})"
        if self.kind == CYCLE:
            return f"stable cycle of period {len(self.points)} through ({numbers})"
        return f"chaotic attractor, exponent {self.exponents[0]:.3g} +- {self.bars[0]:.1g}"


@dataclasses.dataclass(frozen=True)
class Basins:
    """The attractor that each start approaches.

    Attributes:
      scene: scene of the motions; None for a map.
      title: the name of the scene or the map.
      names: names of the varied entries of the start, one for each axis.
      axes: their values.
      labels: (n1, n2, ...) number of the attractor of each start; -1 if none was reached in time,
        or the motion stopped.
      attractors: the attractors.
      time: time of the longest motions; for a map, the number of steps.
      computed: number of motions that ran; fewer than there are labels if the boundary was refined.
      fractions: (a + 1,) fractions of the starts of the given grid; the last one is that of starts
        that reach none.
      bars: (a + 1,) half-widths of their 95 % intervals, as if the starts were drawn at random.
    """

    scene: Scene | None
    title: str
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
        said = [f"{i}: {a.said}" for i, a in enumerate(self.attractors)]
        said.append(f"none within {self._time}")
        for text, share, bar in zip(said, self.fractions, self.bars, strict=True):
            rows.append((f"{100 * share:.2f} +- {100 * bar:.2f} %", text))
        if self.fractions[-1] > 0 and self.scene is not None:
            rows.append(("", "rounds= lets those that reach none run longer"))
        shape = " x ".join(map(str, self.labels.shape))
        head = f"Basins of {self.title}, {shape} starts in {', '.join(self.names)}"
        return _text.table(head, rows)

    _repr_html_ = _text.html

    @property
    def _time(self) -> str:
        if self.scene is None:
            return _text.number_of(int(self.time), "step")
        return _text.brief(self.time, _text.second(self.scene.labels()))

    @property
    def entries(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of each entry of the state."""
        if self.scene is None:
            return tuple((name, "1") for name in self.names)
        return self.scene.labels()

    def plot(self, path=None, *, title: str | None = None):
        """A picture of the basins and of the attractors; see `orbits.drawing.basins`."""
        from orbits.drawing import basin_maps

        return basin_maps.basins(self, path, title=title)


def as_axes(grid: Any, known: list[str] | None = None) -> dict[str, np.ndarray]:
    """Values of entries by name.

    Raises:
      ValueError: there are none, one is not among the known names, or values are not numbers.
    """
    names = tuple(grid) if isinstance(grid, Mapping) else ()
    if not names:
        remedy = 'For example {"x": np.linspace(-1, 1, 100)}.'
        raise _checks.fail("grid", "values of entries by name", repr(grid)[:60], remedy)
    for name in () if known is None else names:
        _checks.choice("grid", name, known)
    axes = {name: np.asarray(_checks.host_array(name, x, (None,))) for name, x in grid.items()}
    for name, values in axes.items():
        if not len(values):
            raise _checks.fail(name, "at least one value", "none")
    return axes


def check_rounds(rounds: int, refine: int, axes: Mapping[str, np.ndarray]) -> None:
    """Raise ValueError unless the number of rounds and of refinements suits a grid."""
    _checks.whole("rounds", rounds)
    _checks.whole("refine", refine, 0, 10)
    if refine and len(axes) != 2:
        raise _checks.fail("refine", "a grid of two entries", len(axes), "Leave it out.")


def over_grid(
    settling: "Settling",
    grid: Mapping[str, np.ndarray],
    start: np.ndarray,
    entries: list[int],
    refine: int,
    *,
    scene: Scene | None,
    title: str,
) -> Basins:
    """The basins over all combinations of values of entries of a start (k,)."""

    def starts(*values: np.ndarray) -> np.ndarray:
        y0s = np.tile(start, (values[0].size, 1))
        for entry, x in zip(entries, values, strict=True):
            y0s[:, entry] = x.ravel()
        return y0s

    axes = tuple(grid.values())
    first = starts(*np.meshgrid(*axes, indexing="ij"))
    found = settling.labels(first).reshape([len(x) for x in axes])
    counts = [np.mean(found == i) for i in range(len(settling.attractors))]
    fractions = np.array([*counts, np.mean(found < 0)])
    for _ in range(refine):
        axes, found = _refine(axes, found, settling, starts)
    return Basins(
        scene=scene,
        title=title,
        names=tuple(grid),
        axes=axes,
        labels=found,
        attractors=tuple(settling.attractors),
        time=settling.longest,
        computed=settling.computed,
        fractions=fractions,
        bars=_SD * np.sqrt(fractions * (1 - fractions) / len(first)),
    )


def _refine(axes, labels: np.ndarray, settling: "Settling", starts: Callable):
    """Axes and labels with a value between every two; only starts at a boundary are run."""
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


class Settling(abc.ABC):
    """Motions that run until they are near an attractor, and the attractors found so far.

    Attributes:
      span: time of a round.
      rounds: number of rounds.
      kept: the states after each round, which a file may keep.
      attractors: the attractors found.
      longest: time of the longest motions.
      computed: number of motions.
      sizes: (k,) sizes of the entries of a state.
      tries: number of ends in succession without a new attractor after which the search of a round
        stops.
    """

    tries = 6

    def __init__(self, span: float, rounds: int, k: int, kept: Rows):
        self.span, self.rounds, self.kept = span, rounds, kept
        self.attractors: list[Attractor] = []
        self.longest, self.computed = 0.0, 0
        self.sizes = np.ones(k)

    @property
    def is_curve(self) -> bool:
        """Whether the points of an orbit form a curve."""
        return False

    @property
    @abc.abstractmethod
    def ends(self) -> Callable[[np.ndarray], np.ndarray]:
        """The function from starts (n, k) to states after a round, NaN where a motion stops."""

    @abc.abstractmethod
    def largest(self, y0s: np.ndarray) -> np.ndarray:
        """(k,) sizes of the entries along motions from these starts."""

    @abc.abstractmethod
    def difference(self, ys: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, k) differences of states from one."""

    @abc.abstractmethod
    def wrap(self, ys: np.ndarray) -> np.ndarray:
        """(n, k) the states, with angles within half a turn of those of a fixed state."""

    @abc.abstractmethod
    def attractor(self, y: np.ndarray, last: bool) -> Attractor | None:
        """A new attractor near the end of a motion; a chaotic one in the last round only."""

    def labels(self, y0s: np.ndarray) -> np.ndarray:
        """(n,) number of the attractor of each start."""
        self.computed += len(y0s)
        found = np.full(len(y0s), -1)
        ends = self.kept.compute(y0s, self.ends)
        if not self.attractors:
            self.sizes = self.largest(y0s[np.isfinite(ends).all(axis=1)])
        for number in range(1, self.rounds + 1):
            self.longest = max(self.longest, number * self.span)
            last = number == self.rounds
            self._match(ends, found, last)
            self._discover(ends, found, last)
            open_ = (found < 0) & np.isfinite(ends).all(axis=1)
            if last or not open_.any():
                break
            ends[open_] = self.kept.compute(ends[open_], self.ends)
        return found

    def beside(self, y: np.ndarray) -> np.ndarray:
        """A state (k,) near `y`: an attractor is reached from it too, but a saddle is not."""
        return y + 0.5 * REACHED * self.sizes

    def apart(self, ys: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) largest entry of the difference of states from one, relative to sizes."""
        return np.abs(self.difference(ys, y) / self.sizes[None]).max(axis=1)

    def _match(self, ends: np.ndarray, found: np.ndarray, last: bool, only=None) -> None:
        """Label the ends that are near an attractor; near a chaotic one in the last round only."""
        for i, attractor in enumerate(self.attractors):
            if (only is not None and i != only) or (attractor.kind == CHAOTIC and not last):
                continue
            open_ = np.flatnonzero((found < 0) & np.isfinite(ends).all(axis=1))
            if len(open_):
                near = self.is_near(attractor, ends[open_])
                found[open_[near]] = i

    def is_near(self, attractor: Attractor, ys: np.ndarray) -> np.ndarray:
        """(n,) whether states are near an attractor."""
        points = self.wrap(attractor.points) / self.sizes
        places = self.wrap(ys) / self.sizes
        tree = cKDTree(points)
        distance, nearest = tree.query(places, p=np.inf)
        if attractor.kind == CHAOTIC:
            gaps = tree.query(points, k=2, p=np.inf)[0][:, 1]
            return distance < _CLOUD_SPACING * np.quantile(gaps, 0.999)
        if attractor.kind == ORBIT and self.is_curve:
            for side in (-1, 1):  # between samples an orbit is nearly straight
                other = points[(nearest + side) % len(points)]
                along = other - points[nearest]
                length = np.maximum(np.sum(along**2, axis=1), np.finfo(float).tiny)
                share = np.sum((places - points[nearest]) * along, axis=1) / length
                foot = points[nearest] + np.clip(share, 0, 1)[:, None] * along
                distance = np.minimum(distance, np.abs(places - foot).max(axis=1))
        return distance < REACHED

    def _discover(self, ends: np.ndarray, found: np.ndarray, last: bool) -> None:
        """Search for attractors where motions that are not near any have ended."""
        tried = np.zeros(len(ends), bool)
        failed = 0
        while failed < self.tries:
            open_ = np.flatnonzero((found < 0) & ~tried & np.isfinite(ends).all(axis=1))
            if not len(open_):
                return
            one = open_[failed * len(open_) // self.tries]  # far from those that failed
            tried[one] = True
            new = self.attractor(ends[one], last)
            if new is None:
                failed += 1
                continue
            self.attractors.append(new)
            self._match(ends, found, last, only=len(self.attractors) - 1)
            failed = failed + 1 if found[one] < 0 else 0
