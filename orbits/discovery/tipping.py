"""Basins along a parameter: their fractions, and where attractors appear and disappear.

Attractors at neighbouring values of the parameter are paired so that the sum of their distances is
least; a pair that is not too far apart is the same attractor. Where one has no such neighbour, a
motion that follows it tips to another attractor.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from jaxdyn import _checks, _text
from orbits.discovery.settling import Attractor, Basins

_WITHIN = 0.3  # relative to the sizes: largest shift of an attractor from one value to the next


class Tipping(NamedTuple):
    """A tipping point, where an attractor appears or disappears.

    Attributes:
      attractor: its number.
      begins: whether it exists above but not below; otherwise the reverse.
      low: value of the parameter below.
      high: value of the parameter above.
    """

    attractor: int
    begins: bool
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class BasinFractions:
    """Fractions of basins along a parameter.

    Attributes:
      values: (n,) values of the parameter.
      fractions: (n, a + 1) fractions of the starts that approach each attractor, 0 where it does
        not exist; the last ones are those of starts that reach none.
      bars: (n, a + 1) half-widths of their 95 % intervals.
      attractors: for each number, the attractors along the parameter, None where it does not exist.
      found: the basins at each value.
    """

    values: np.ndarray
    fractions: np.ndarray
    bars: np.ndarray
    attractors: tuple[tuple[Attractor | None, ...], ...]
    found: tuple[Basins, ...]

    @property
    def tipping(self) -> tuple[Tipping, ...]:
        """Where attractors appear and disappear, in the order of the parameter."""
        points = [
            Tipping(i, before is None, float(low), float(high))
            for i, each in enumerate(self.attractors)
            for low, high, before, after in zip(
                self.values, self.values[1:], each, each[1:], strict=False
            )
            if (before is None) != (after is None)
        ]
        return tuple(sorted(points, key=lambda point: point.low))

    @_text.never_raising
    def __repr__(self) -> str:
        rows = []
        for value, shares in zip(self.values, self.fractions, strict=True):
            rows.append((f"{value:.6g}", ", ".join(f"{100 * x:.2f} %" for x in shares)))
        rows += [
            (f"{i}", f"{next(one.said for one in each if one is not None)}, where it begins")
            for i, each in enumerate(self.attractors)
        ]
        for point in self.tipping:
            what = "begins" if point.begins else "ends"
            where = f"{what} between {point.low:.6g} and {point.high:.6g}"
            rows.append(("tipping", f"attractor {point.attractor} {where}"))
        many = _text.number_of(len(self.attractors), "attractor")
        return _text.table(f"Fractions of the basins of {many}, and of none, along values", rows)

    _repr_html_ = _text.html

    def plot(self, path=None, *, title: str | None = None):
        """A picture of the fractions over the parameter; see `orbits.drawing.basin_fractions`."""
        from orbits.drawing import basin_maps

        return basin_maps.basin_fractions(self, path, title=title)


def basin_fractions(
    find: Callable[[Any], Basins], values: Sequence[float], *, within: float = _WITHIN
) -> BasinFractions:
    """The fractions of basins along a parameter, and its tipping points.

    Args:
      find: function of a value of the parameter that returns basins over the same grid, by a call
        of `orbits.basins` or `orbits.map_basins`.
      values: values of the parameter, ascending.
      within: largest shift of an attractor from one value to the next, relative to the sizes of its
        entries and of the grid; attractors farther apart are different.
    Returns:
      Fractions with bars, attractors with their numbers, tipping points, and all basins.
    Raises:
      ValueError: `values` do not ascend, or `find` does not return basins in the same entries.
    Limits: see `basins`; an attractor whose basin is smaller than the spacing of the grid is
      missed, so that it may seem to tip too early.
    Example:
      >>> import orbits, numpy as np
      >>> def cubic(y, p):  # x' = p + x - x^3, in steps
      ...     return [y[0] + 0.1 * (p + y[0] - y[0] ** 3)]
      >>> grid = {"x": np.linspace(-2.0, 2.0, 41)}
      >>> found = orbits.basin_fractions(
      ...     lambda p: orbits.map_basins(cubic, grid, params=p), [0.0, 0.2, 0.3, 0.5, 0.6])
      >>> [(point.begins, point.low, point.high) for point in found.tipping]  # 2 / 27^(1/2) = 0.385
      [(False, 0.3, 0.5)]
    """
    _checks.check_on_host("basin_fractions", values)
    at = np.asarray(_checks.host_array("values", values, (None,)))
    if not (len(at) and (np.diff(at) > 0).all()):
        raise _checks.fail("values", "ascending ones, at least one", at)
    _checks.positive("within", within)
    _checks.check_callable("find", find, "value")
    found, tracks = [], []
    for i, value in enumerate(at.tolist()):
        basins = find(value)
        if not isinstance(basins, Basins):
            raise _checks.fail("find", "a function that returns basins", type(basins).__name__)
        if found and basins.names != found[0].names:
            raise _checks.fail("find", f"basins in {found[0].names}", basins.names)
        found.append(basins)
        last = [track[-1] for track in tracks]
        for track in tracks:
            track.append(None)
        same = _same(last, basins, within)
        for number, attractor in enumerate(basins.attractors):
            if number not in same:
                tracks.append([None] * i + [attractor])
            else:
                tracks[same[number]][-1] = attractor
    fractions, bars = (np.zeros((len(at), len(tracks) + 1)) for _ in range(2))
    for i, basins in enumerate(found):
        fractions[i, -1], bars[i, -1] = basins.fractions[-1], basins.bars[-1]
        for j, track in enumerate(tracks):
            if track[i] is not None:
                number = next(n for n, one in enumerate(basins.attractors) if one is track[i])
                fractions[i, j], bars[i, j] = basins.fractions[number], basins.bars[number]
    return BasinFractions(at, fractions, bars, tuple(map(tuple, tracks)), tuple(found))


def _same(last: list[Attractor | None], basins: Basins, within: float) -> dict[int, int]:
    """For each attractor that was there at the last value: its number -> its index in `last`."""
    there = [i for i, one in enumerate(last) if one is not None]
    if not there or not basins.attractors:
        return {}
    before = [last[i] for i in there]
    sizes = _sizes([*before, *basins.attractors], basins)
    apart = np.array([[_apart(a, b, sizes) for b in before] for a in basins.attractors])
    rows, columns = linear_sum_assignment(np.minimum(apart, 1 / np.finfo(float).eps))
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return {i: there[j] for i, j in pairs if apart[i, j] <= within}


def _sizes(attractors: list, basins: Basins) -> np.ndarray:
    """(k,) extent of the entries over attractors and the grid."""
    points = np.concatenate([one.points for one in attractors])
    extent = points.max(axis=0) - points.min(axis=0)
    names = [name for name, _ in basins.entries]
    for name, axis in zip(basins.names, basins.axes, strict=True):
        i = names.index(name)
        extent[i] = max(extent[i], axis.max() - axis.min())
    return np.where(extent > 0, extent, 1.0)


def _apart(a: Attractor, b: Attractor, sizes: np.ndarray) -> float:
    """Distance of the centroids of two attractors, relative to sizes."""
    middles = (one.points.mean(axis=0) / sizes for one in (a, b))
    return float(np.abs(np.subtract(*middles)).max())
