"""Pictures of equilibria over a parameter, and of curves of bifurcations over two."""

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import PchipInterpolator

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn._text import with_unit
from jaxdyn.continuation.curve import beside_chords
from jaxdyn.continuation.family import Equilibrium, EquilibriumFamily
from jaxdyn.continuation.kinds import Kind
from jaxdyn.drawing.figures import PALETTE, blank, finish, legend_below, legend_entries, style
from jaxdyn.drawing.titles import readable
from jaxdyn.files.output_files import picture_path

#: Line styles of verdicts.
STRETCHES = {"stable": "-", "unstable": (0, (4, 2)), "undecided": ":"}
#: Marks of special equilibria.
EQUILIBRIUM_MARKERS = {
    Kind.FOLD: "s",
    Kind.BRANCH: "D",
    Kind.HOPF: "o",
    Kind.KREIN: "X",
}
#: Markers of the kinds of points of codimension two, in the order of their first appearance.
_SHAPES = "^Do*XsvPpd<>"
_SUBCRITICAL = (0, (4, 2))
#: Largest distance of a special point from a line between whose ends it lies, in lengths of the
#: line.
_BESIDE = 0.5
#: Relative change of a coordinate along a line that is due to rounding.
_ROUNDING = 1e-13
#: Number of straight pieces drawn between two computed points.
_PIECES = 12


@check_first
def equilibria(
    families: EquilibriumFamily | Sequence[EquilibriumFamily],
    path=None,
    *,
    entry: str | None = None,
    parameter: str = "parameter",
    title: str | None = None,
) -> Figure:
    """A picture of families of equilibria: one entry of the state over the parameter.

    Stable stretches are solid and unstable ones dashed; stretches without a verdict, or on which it
    changes without a special point, are dotted. Special points are marked, subcritical ones
    by an open mark.

    Args:
      families: results of `continue_equilibria` and `switch_branch` for one scene, or one of them.
      path: file to write, .png, .pdf or .svg.
      entry: name of the entry; by default the one that changes most.
      parameter: name of the parameter.
      title: title of the picture.
    Raises:
      ValueError: `path` cannot be written, there is no family, or no such entry.
    """
    path = picture_path(path)
    families = [families] if isinstance(families, EquilibriumFamily) else families
    if not families:
        raise _checks.fail("families", "at least one", "none")
    index, label = entry_of(families, entry)
    figure = blank(6.8, 4.6)
    ax: Any = figure.add_subplot()
    draw_equilibria(ax, families, index)
    for point in (x for family in families for x in family.special):
        mark_special(ax, point, point.state[index])
    ax.set(xlabel=parameter, ylabel=label, title=readable(title))
    style(ax)
    legend_below(figure, legend_entries(ax))
    return finish(figure, path)


def mark_special(ax, point: Equilibrium, height: float) -> None:
    """Mark a special equilibrium at its parameter and a height."""
    kinds = list(EQUILIBRIUM_MARKERS)
    colour = PALETTE[1 + kinds.index(point.kind)]
    inside = "white" if point.criticality == "subcritical" else colour
    look = {"color": colour, "mfc": inside, "ms": 7, "zorder": 4, "ls": ""}
    marker = EQUILIBRIUM_MARKERS[point.kind]
    ax.plot([point.parameter], [height], marker, label=point.name, **look)


def bifurcation_curves(curves: Sequence, path=None, *, title: str | None = None) -> Figure:
    """A picture of curves of bifurcations in the plane of their parameters.

    Curves of subcritical Hopf points are dashed, dotted where it is not known whether they are;
    points of codimension two are marked.

    Args:
      curves: results of `jaxdyn.continue_curve` and `orbits.continue_curve`, for one scene and the
        same parameters.
      path: file to write, .png, .pdf or .svg.
      title: title of the picture.
    Raises:
      ValueError: `path` cannot be written, or there is no curve.
    """
    path = picture_path(path)
    if not isinstance(curves, list | tuple):
        wanted = "a list of results of continue_curve"
        raise _checks.fail("curves", wanted, type(curves).__name__, "Write [curve].")
    if not curves:
        raise _checks.fail("curves", "at least one", "none")
    figure = blank(6.8, 4.6)
    ax: Any = figure.add_subplot()
    kinds = list(dict.fromkeys(curve.kind for curve in curves))
    for curve in curves:
        colour = PALETTE[kinds.index(curve.kind) % len(PALETTE)]
        pairs = itertools.pairwise(curve.points)
        found = runs((_criticality(*pair), *pair) for pair in pairs)
        for which, points in found:
            label = " ".join(filter(None, (which, curve.kind)))
            unknown = not which and len(found) > 1
            dashes = _SUBCRITICAL if which == "subcritical" else ":" if unknown else "-"
            ax.plot(*curve.line(points).T, color=colour, lw=1.8, ls=dashes, label=label)
    special = [point for curve in curves for point in curve.special]
    marks = dict.fromkeys(str(point.kind) for point in special)
    colours = itertools.cycle(PALETTE[len(kinds) :] + PALETTE[: len(kinds)])
    for kind, shape, colour in zip(marks, itertools.cycle(_SHAPES), colours, strict=False):
        there = np.array([point.parameters for point in special if point.kind == kind])
        ax.plot(*there.T, shape, color=colour, ms=7, zorder=4, label=kind, ls="")
    ax.set(xlabel=curves[0].names[0], ylabel=curves[0].names[1], title=readable(title))
    style(ax)
    legend_below(figure, legend_entries(ax))
    return finish(figure, path)


def runs(pieces: Iterable[tuple[str, Any, Any]]) -> list[tuple[str, list]]:
    """Pieces of lines, each a property and two ends, joined if the property and an end agree."""
    found: list[tuple[str, list]] = []
    for which, one, two in pieces:
        if found and found[-1][0] == which and found[-1][1][-1] is one:
            found[-1][1].append(two)
        else:
            found.append((which, [one, two]))
    return found


def stretches(
    points: Sequence,
    special: Sequence,
    verdict: Callable[[Any], str],
    place: Callable[[Any], Any],
) -> list[tuple[str, list, bool]]:
    """Runs of points of one verdict, through special points, and whether legends name them.

    Where the verdict changes without a special point to cut at, the line is drawn like one without
    a verdict. If no point of it is undecided, legends do not name it, since they would name a line
    that nobody sees.
    """
    pieces = []
    at = in_extents(points, place)
    between = _between(np.array([at(x) for x in points]), special, at)
    for (one, two), cuts in zip(itertools.pairwise(points), between, strict=True):
        first, last = verdict(one), verdict(two)
        if first == last:
            pieces += [(first, *ends) for ends in itertools.pairwise([one, *cuts, two])]
        elif cuts and "undecided" not in (first, last):
            pieces += [(first, one, cuts[0]), (last, cuts[-1], two)]
        else:
            pieces.append(("undecided", one, two))
    return [
        (which, several, which != "undecided" or which in map(verdict, several))
        for which, several in runs(pieces)
    ]


def draw_stretches(
    ax,
    found: Sequence[tuple[str, list, bool]],
    place: Callable[[Any], tuple[float, float]],
    name: str,
    **look,
) -> None:
    """Draw stretches of a line in the styles of their verdicts.

    Args:
      ax: axes, with their scales.
      found: result of `stretches`.
      place: point -> where it is in the picture.
      name: the name in the legend, with {} for the verdict.
      look: Matplotlib properties that all of them have.
    """
    lines = smooth(ax, [[place(x) for x in points] for _, points, _ in found])
    for (verdict, _, shown), line in zip(found, lines, strict=True):
        label = name.format(verdict) if shown else "_"
        ax.plot(*line.T, ls=STRETCHES[verdict], label=label, **look)


def smooth(ax, lines: Sequence) -> list[np.ndarray]:
    """Smooth curves through the points of lines (n, 2), in the scales of a picture's axes.

    The points of lines that follow one another, each from where the last one ended, lie on one
    curve. It is a monotone cubic of Fritsch and Carlson (SIAM J. Numer. Anal. 17, 238, 1980) in
    each coordinate, over the length of the chords: between two points it stays within their
    values, so that no extreme is drawn that was not computed.
    """
    scale = ax.transScale
    lines = [scale.transform(np.asarray(line, float)) for line in lines]
    curves = []
    for first in (i for i, line in enumerate(lines) if not i or _has_gap(lines[i - 1], line)):
        last = first + 1
        while last < len(lines) and not _has_gap(lines[last - 1], lines[last]):
            last += 1
        curves += _through(lines[first:last])
    return [scale.inverted().transform(curve) for curve in curves]


def _has_gap(before: np.ndarray, after: np.ndarray) -> bool:
    return not np.array_equal(before[-1], after[0])


def _through(lines: list[np.ndarray]) -> list[np.ndarray]:
    """The curve through lines without gaps, cut where they are."""
    points = np.concatenate([lines[0][:1], *(line[1:] for line in lines)])
    extent = np.ptp(points, axis=0)
    chords = np.linalg.norm(np.diff(points, axis=0) / np.where(extent > 0, extent, 1.0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(chords)])
    apart = np.concatenate([[True], np.diff(length) > 0])
    if not np.isfinite(points).all() or apart.sum() < 3:
        return lines
    curve = PchipInterpolator(length[apart], points[apart])
    found, first = [], 0
    for line in lines:
        ends = length[first : first + len(line)]
        parts = np.linspace(ends[:-1], ends[1:], _PIECES, endpoint=False, axis=1).ravel()
        found.append(curve(np.append(parts, ends[-1])))
        first += len(line) - 1
    return found


def in_extents(points: Sequence, place: Callable[[Any], Any]) -> Callable[[Any], np.ndarray]:
    """The places of points in units of their extents along a line, one for each coordinate.

    Coordinates may differ in size by orders of magnitude, as a displacement in m and a frequency in
    rad/s do. One that changes by rounding alone keeps its unit.
    """
    at = np.array([place(x) for x in points], float)
    extent = np.ptp(at, axis=0)
    scale = np.where(extent > _ROUNDING * np.abs(at).max(), extent, 1.0)
    return lambda x: np.asarray(place(x), float) / scale


def _between(at: np.ndarray, special: Sequence, place: Callable) -> list[list]:
    """The special points between each two neighbours of points at (n, k), in order.

    Each belongs to the nearest of the lines that join them, if it is closer to that than half its
    length.
    """
    found: list[list] = [[] for _ in at[1:]]
    for x in special:
        share, apart = beside_chords(at, place(x))
        nearest = int(np.argmin(apart)) if len(apart) else 0
        if len(apart) and apart[nearest] < _BESIDE:
            found[nearest].append((share[nearest], x))
    return [[x for _, x in sorted(several, key=lambda pair: pair[0])] for several in found]


def with_special(points: Sequence, special: Sequence, place: Callable[[Any], Any]) -> list:
    """Points along a line, with its special points inserted between them."""
    at = in_extents(points, place)
    between = _between(np.array([at(x) for x in points]), special, at)
    first = [x for one, cuts in zip(points, between, strict=False) for x in (one, *cuts)]
    return [*first, points[-1]]


def _criticality(one, two) -> str:
    """The criticality of two neighbouring points; "" if neither has one.

    Only Hopf points have one, except for special points between them.
    """
    return getattr(one, "criticality", "") or getattr(two, "criticality", "")


def draw_equilibria(ax, families: Sequence[EquilibriumFamily], index: int, of: str = "") -> None:
    """Draw the `stretches` of families of equilibria; `of` begins their names in the legend."""
    for family in families:
        found = stretches(family.members, family.special, lambda x: x.verdict, lambda x: x.x)

        def place(x) -> tuple[float, float]:
            return x.parameter, x.state[index]

        draw_stretches(ax, found, place, f"{of}{{}}", color=PALETTE[0], lw=1.8)


def entry_of(families: Sequence[EquilibriumFamily], entry: str | None) -> tuple[int, str]:
    """The index of the entry of the state that is drawn, and its name with its unit."""
    first = families[0].members[0]
    labels = families[0].make(np.asarray(first.parameter)).labels()
    if entry is None:
        states = np.concatenate([family.states for family in families])
        index = int(np.argmax(np.ptp(states, axis=0)))
    else:
        names = [name for name, _ in labels]
        index = names.index(_checks.choice("entry", entry, names))
    return index, with_unit(*labels[index])
