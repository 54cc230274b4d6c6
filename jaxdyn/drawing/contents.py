"""The contents of a picture of a motion: paths of points, and moving shapes.

They are plain arrays for any drawing library: Matplotlib for pictures and animations, or the one of
a page in a browser. The look of a scene is defined by `System.sketch` and `Effect.sketch`.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn._text import second, with_unit
from jaxdyn.drawing.curves import Outline, Part, fine, samples_reached
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.sketch import NAMED, Kind

_LOOKS = 100  # number of samples at which the extent of shapes is evaluated
_NEAR = 1.0  # distance of a mark from a motion, over the motion's extent, up to which it is drawn


class Moving(NamedTuple):
    """A shape along a motion: its kind and its corners (s, m, k, D), m lines of k corners."""

    kind: Kind
    at: np.ndarray


class Paths(NamedTuple):
    """The data for a picture of a motion.

    Attributes:
      ts: (s,) times of the samples that the run reached.
      xyz: (s, n, D) paths that are drawn, each in its own colour, D = 2 or 3; (time, x) for motion
        on a line.
      names: (n,) names of the paths; empty for a single one.
      labels: (D,) labels of the axes.
      second: the unit of time after a number: " s", or "" where G = 1.
      equal: whether all axes have one scale.
      stopped: why the run stopped early; empty if it did not.
      shapes: the moving shapes; on axes of two scales only lines.
      marks: names and positions (D,) of the fixed places near the motion.
      corners: indices of the samples where a later phase of a chain begins.
    """

    ts: np.ndarray
    xyz: np.ndarray
    names: tuple[str, ...]
    labels: tuple[str, ...]
    second: str
    equal: bool
    stopped: str
    shapes: tuple[Moving, ...]
    marks: tuple[tuple[str, np.ndarray], ...]
    corners: tuple[int, ...]


@check_first
def paths(motion: Trajectory | HybridTrajectory, entries: Sequence[str] | None = None) -> Paths:
    """The contents of a picture of a motion, a chain of phases or the part of a run that stopped.

    Points move in a plane, in space or on a line; a system without points is drawn in its state
    space, of two or three dimensions. The paths are those that the scene's sketch names (its
    traces), or those of all points.

    Args:
      motion: result of `simulate` or `simulate_phases`.
      entries: names of two or three entries of the state that are drawn instead.
    Raises:
      ValueError: `motion` is a batch or has nothing to draw, or `entries` are not such names.
    """
    pieces = pieces_of(motion)
    which = [indices_of(entries, piece.scene) for piece in pieces]
    good = [samples_reached(piece) for piece in pieces]
    parts = [
        fine(piece, n, len(pieces), of)
        for piece, n, of in zip(pieces, good, which, strict=True)
        if n
    ]
    parts = parts or [fine(pieces[0], 0, 1, which[0])]
    ts = np.concatenate([part.ts for part in parts])
    points = np.concatenate([part.points for part in parts])
    n, d = points.shape[1:]
    if d > 3:
        raise _checks.fail(
            "motion",
            "material points, or a state of at most 3 entries",
            f"no points and a state of {d}",
            "Choose some with entries=, or draw them against time with drawing.time_series.",
        )
    outlines = _common(parts)
    traces = [(outline.name, at[:, 0]) for outline, at in outlines if outline.kind == "trace"]
    names = tuple(name for name, _ in traces) or (pieces[0].scene.point_names if n > 1 else ())
    xyz = np.concatenate([at for _, at in traces], axis=1) if traces else points
    marks = [(outline.name, at[0, 0, 0]) for outline, at in outlines if outline.kind == "mark"]
    named = _axes(pieces[0], d, which[0])
    symbols, second = _axis_labels(pieces[0], named)
    shapes = [Moving(outline.kind, at) for outline, at in outlines if outline.kind not in NAMED]
    if d == 1:
        xyz, symbols = _against(ts, xyz), (f"t [{second.strip()}]" if second else "t", *symbols)
        shapes = [Moving(kind, _against(ts, at)) for kind, at in shapes if kind == "line"]
    return Paths(
        ts=ts,
        xyz=xyz,
        names=names if any(names) else (),
        labels=symbols,
        second=second,
        equal=d > 1 and len({unit for _, unit in named}) == 1,
        stopped=why_stopped(motion, second),
        shapes=tuple(shapes),
        marks=tuple((name, at) for name, at in marks if _is_near(at, xyz)),
        corners=tuple(np.cumsum([len(part.ts) for part in parts])[:-1].tolist()),
    )


def why_stopped(motion: Trajectory | HybridTrajectory, second: str = " s") -> str:
    """A line that says why and when a run stopped early; empty if it did not."""
    last = pieces_of(motion)[-1]
    good = samples_reached(last)
    if good == len(last.ts):
        return ""
    what = re.split(r"[.(] ?|: ", last.message)[0].strip()
    return f"{what} (t = {last.ts[good - 1]:.4g}{second})" if good else what


def places(drawn: Paths, *, shapes: bool = True) -> np.ndarray:
    """(p, D) all points that must fit in the picture: the paths, the marks, and the shapes."""
    size = drawn.xyz.shape[-1]
    thin = slice(None, None, max(1, len(drawn.ts) // _LOOKS))
    corners = [at[thin].reshape(-1, size) for _, at in drawn.shapes if shapes]
    fixed = [at[None] for _, at in drawn.marks]
    return np.concatenate([drawn.xyz.reshape(-1, size), *fixed, *corners])


def in_time(drawn: Paths, count: int) -> np.ndarray:
    """(count,) indices of the samples nearest to evenly spaced times."""
    wanted = np.linspace(drawn.ts[0], drawn.ts[-1], count)
    sign = 1.0 if drawn.ts[-1] >= drawn.ts[0] else -1.0
    after = np.clip(np.searchsorted(sign * drawn.ts, sign * wanted), 1, len(drawn.ts) - 1)
    nearer = np.abs(drawn.ts[after - 1] - wanted) < np.abs(drawn.ts[after] - wanted)
    return after - nearer


def _common(parts: Sequence[Part]) -> list[tuple[Outline, np.ndarray]]:
    """The outlines (s, m, k, d) common to all parts, since phases may have different effects."""
    kept = [
        outline for outline in parts[0].outlines if all(outline in part.outlines for part in parts)
    ]
    return [(x, np.concatenate([part.outlines[x] for part in parts])) for x in kept]


def _is_near(place: np.ndarray, xyz: np.ndarray) -> bool:
    """Whether a place (D,) would fit in a picture of paths (s, n, D) of about their own size."""
    if not xyz.size:
        return False
    low, high = xyz.min(axis=(0, 1)), xyz.max(axis=(0, 1))
    room = _NEAR * (high - low).max()
    return bool((low - room <= place).all() and (place <= high + room).all())


def _against(ts: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(s, ..., 2) time and x of places (s, ..., 1) on a line."""
    time = np.broadcast_to(ts.reshape(-1, *[1] * (places.ndim - 1)), places.shape)
    return np.concatenate([time, places], axis=-1)


def indices_of(entries: Sequence[str] | None, scene: Scene) -> list[int]:
    """The indices of the entries of the state with these names; none for None.

    Raises:
      ValueError: they are not two or three names of entries.
    """
    if entries is None:
        return []
    names = [name for name, _ in scene.labels()]
    if isinstance(entries, str) or len(entries) not in (2, 3):
        raise _checks.fail(
            "entries", "two or three names", repr(entries), f"Choose from {', '.join(names)}."
        )
    return [names.index(_checks.choice("entries", name, names)) for name in entries]


def _axes(piece: Trajectory, d: int, which: Sequence[int]) -> list[tuple[str, str]]:
    """(d,) names and units of the directions, from the state's labels."""
    labels = piece.scene.labels()
    if which or not piece.scene.has_points:
        return [labels[i] for i in which or range(len(labels))]
    units, length = dict(labels), (piece.scene.units or ("m",))[0]
    return [(x, units.get(x, units.get(x + "1", length))) for x in "xyz"[:d]]


def _axis_labels(
    piece: Trajectory, named: Sequence[tuple[str, str]]
) -> tuple[tuple[str, ...], str]:
    """(d,) labels of the axes, and the unit of time after a number."""
    plain = all(unit == "1" for _, unit in named)
    time = "" if plain else f" {second(piece.scene.labels()) or 's'}"
    return tuple(with_unit(x, unit) for x, unit in named), time
