"""The strokes of a drawing at one sample of a motion: polylines, by style.

They are plain arrays, independent of a drawing library, for pictures and animations;
`jaxdyn/player/canvas.js` makes its own strokes, of the same proportions.
Springs get their coils here, dashpots their cylinder; straight ground lines extend as far as the
motion above them.
"""

from typing import NamedTuple

import numpy as np

from jaxdyn.drawing.contents import Paths

_COILS = 9
_LEAD = 0.12  # straight part at each end of a spring, as a share of its length
_ROUND = 12  # number of corners of a coil in space
_BESIDE = 2.5  # offset of a dashpot from its spring, in widths


class Strokes(NamedTuple):
    """Polylines (k, D) by style; those of areas and solids are closed; pins (p, D)."""

    lines: list[np.ndarray]
    springs: list[np.ndarray]
    areas: list[np.ndarray]
    solids: list[np.ndarray]
    pins: np.ndarray


def strokes(drawn: Paths, sample: int, width: float) -> Strokes:
    """The strokes of the shapes at a sample, with springs of this half width [m]."""
    of = {
        kind: [line for k, at in drawn.shapes if k == kind for line in at[sample]]
        for kind in ("line", "area", "solid", "spring", "dashpot", "pin")
    }
    springs = [coil(ends, width) for ends in of["spring"]]
    springs += [stroke for ends in of["dashpot"] for stroke in dashpot(ends, width)]
    pins = np.concatenate([np.zeros((0, drawn.xyz.shape[-1])), *of["pin"]])
    areas, solids = (
        [np.concatenate([line, line[:1]]) for line in of[kind]] for kind in ("area", "solid")
    )
    return Strokes(lines=of["line"], springs=springs, areas=areas, solids=solids, pins=pins)


def grounds(drawn: Paths) -> list[np.ndarray]:
    """(k, D) fixed ground lines; straight ones span the motion, others are at their widest."""
    found = []
    for kind, at in drawn.shapes:
        for line in np.moveaxis(at, 1, 0) if kind == "ground" and len(at) else ():
            along = line[0, -1] - line[0, 0]
            corners = line.reshape(-1, line.shape[-1])
            far = corners @ along
            straight = line.shape[1] == 2
            widest = np.linalg.norm(np.ptp(line, axis=1), axis=-1).argmax()
            found.append(corners[[far.argmin(), far.argmax()]] if straight else line[widest])
    return found


def coil(ends: np.ndarray, width: float) -> np.ndarray:
    """(k, D) the stroke of a spring between ends (2, D): a zigzag in the plane, a helix in space.

    The number of coils does not depend on its length, so that stretching is visible.
    """
    start, end = ends
    across = _across(end - start) * width
    if len(across) == 1:
        share = np.linspace(_LEAD, 1 - _LEAD, 2 * _COILS + 1)
        side = np.zeros(2 * _COILS + 1)
        side[1:-1] = [(-1) ** i for i in range(2 * _COILS - 1)]
        off = side[:, None] * across[0]
    else:
        share = np.linspace(_LEAD, 1 - _LEAD, _ROUND * _COILS + 1)
        angle = 2 * np.pi * _COILS * np.linspace(0.0, 1.0, _ROUND * _COILS + 1)[:, None]
        off = np.cos(angle) * across[0] + np.sin(angle) * across[1]
    coils = start + share[:, None] * (end - start) + off
    return np.concatenate([start[None], coils, end[None]])


def dashpot(ends: np.ndarray, width: float) -> list[np.ndarray]:
    """Polylines (k, D) of a dashpot between ends (2, D), beside the straight line between them."""
    side = _across(ends[1] - ends[0])[0] * width
    start, end = ends + _BESIDE * side
    near, middle, far = (start + share * (end - start) for share in (0.4, 0.5, 0.62))
    cup = np.stack([far + side, near + side, near - side, far - side])
    rods = [np.stack([ends[0], start, near]), np.stack([middle, end, ends[1]])]
    return [*rods, cup, np.stack([middle + side, middle - side])]


def _across(along: np.ndarray) -> np.ndarray:
    """(D - 1, D) unit vectors normal to a direction (D,), or to the first axis if it is zero."""
    length = np.linalg.norm(along)
    along = along / length if length > 0 else np.eye(len(along))[0]
    if len(along) == 2:
        return np.array([[-along[1], along[0]]])
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(along, first)])
