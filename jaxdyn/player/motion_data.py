"""The data of motions for the player, as one JSON object.

Positions are fractions of the box of their motion in 16 bits, finer than any screen; times and the
change of the energy are doubles. Both are little-endian and written in base64, which takes a fifth
of the size of decimal numbers. The frames are states of the curve from `paths` at evenly spaced
times, as many as the size allows. For a shape that moves as a rigid body, only the first frame is
stored, with the linear map and the shift that take it to each of the others.
"""

import base64
import dataclasses
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxdyn import _checks
from jaxdyn.analysis.energy import change
from jaxdyn.drawing.contents import Paths, in_time, paths, places
from jaxdyn.drawing.curves import samples_reached
from jaxdyn.drawing.panels import limits
from jaxdyn.drawing.strokes import grounds
from jaxdyn.files.output_files import replace, writable
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.trajectory import Trajectory, single

VERSION = 2
_MOST_BYTES = 400_000  # limit for all positions of an export
_FRAMES = 60, 900  # smallest and largest number for a motion
_ENERGIES = 500  # samples of the energy
_SHARES = 65535  # the largest integer with 16 bits
_STILL = 1e-9  # relative to its box: a shape that moves less counts as fixed


def export(motions: Any, path=None, *, choose: str = "") -> dict[str, Any]:
    """The data of a motion, or of several, for the player, as an object for JSON.

    Args:
      motions: a result of `simulate` or `simulate_phases`, or a mapping of names to such, all in a
        plane or all in space.
      path: a file to write it to, .json.
      choose: a parameter with its unit, whose values are the names: a slider then selects one
        motion. By default several are shown together.
    Returns:
      The object: axes, and for each motion its times, paths, shapes and energy.
    Raises:
      ValueError: a motion is a batch, has fewer than two samples or nothing to draw, several do
        not fit on the same axes, `choose` is given for one motion, or `path` cannot be written.
    Example:
      >>> from jaxdyn import scenes, simulate
      >>> from jaxdyn.player import export
      >>> shown = export(simulate(scenes.pendulum(), 1.0, samples=50))
      >>> shown["labels"], shown["motions"][0]["count"]
      (['x [m]', 'y [m]'], 1)
    """
    path = None if path is None else writable(path, suffixes=(".json",))
    named = _by_name(motions, choose)
    drawn = {name: paths(one) for name, one in named.items()}
    _check(drawn)
    first = next(iter(drawn.values()))
    box = limits(np.concatenate([places(one) for one in drawn.values()]), first.equal)
    found = {
        "version": VERSION,
        "choose": choose,
        "labels": list(first.labels),
        "second": first.second,
        "equal": first.equal,
        "box": box.T.tolist(),
        "motions": [
            _motion(name, one, drawn[name], _MOST_BYTES // len(drawn))
            for name, one in named.items()
        ],
    }
    if path is not None:
        replace(path, json.dumps(found, allow_nan=False))
    return found


def _by_name(motions: Any, choose: str) -> dict[str, Trajectory | HybridTrajectory]:
    """The motions by name; a single one is called ""."""
    if not isinstance(motions, Mapping):
        motions = {"": motions}
    if choose and len(motions) < 2:
        raise _checks.fail(
            "choose", "several motions to choose from", len(motions), "Pass a mapping of them."
        )
    if not motions:
        raise _checks.fail("motions", "at least one motion", "none")
    for one in motions.values():
        if not isinstance(one, Trajectory | HybridTrajectory):
            wanted = "a motion, or a mapping of names to motions"
            remedy = 'For several: {"first": motion, "second": other}.'
            raise _checks.fail("motions", wanted, type(one).__name__, remedy)
        for piece in pieces_of(one):
            single(piece)
    return {str(name): one for name, one in motions.items()}


def _check(drawn: Mapping[str, Paths]) -> None:
    for name, one in drawn.items():
        if len(one.ts) < 2:
            raise _checks.fail(
                f"motion {name!r}" if name else "motion",
                "at least 2 samples",
                len(one.ts),
                one.stopped or "Simulate with more, over a longer span.",
            )
    if len({one.labels for one in drawn.values()}) > 1:
        raise _checks.fail("motions", "motions in one space", "several", "Play them separately.")


def _motion(name: str, motion: Trajectory | HybridTrajectory, drawn: Paths, most: int) -> dict:
    """The data of one motion, with at most this many bytes of positions."""
    # The box contains every sample: a corner outside would wrap around in its 16 bits.
    everywhere = [drawn.xyz, *(x.at for x in drawn.shapes if x.kind != "ground")]
    ends = np.concatenate([one.reshape(-1, drawn.xyz.shape[-1]) for one in everywhere])
    lo, hi = ends.min(axis=0), ends.max(axis=0)
    hi = np.where(hi > lo, hi, lo + 1.0)
    moving = [x for x in drawn.shapes if x.kind != "ground" and x.at.size]
    still = [_is_still(x.at, hi - lo) for x in moving]
    carried = [
        None if s else _rigid_maps(x.at, hi - lo) for x, s in zip(moving, still, strict=True)
    ]
    frames = [
        2 * x.at[0].size if c is None else 4 * c[0].size
        for x, s, c in zip(moving, still, carried, strict=True)
        if not s
    ]
    size = 2 * drawn.xyz[0].size + sum(frames)
    least, longest = _FRAMES
    count = min(len(drawn.ts), longest, max(least, most // size))
    kept = _forwards(in_time(drawn, count), drawn.ts)
    return {
        "name": name,
        "ts": _text(drawn.ts[kept], "<f8"),
        "lo": lo.tolist(),
        "hi": hi.tolist(),
        "names": list(drawn.names),
        "count": drawn.xyz.shape[1],
        "paths": _shares(drawn.xyz[kept], lo, hi),
        "shapes": [
            {
                "kind": x.kind,
                "lines": x.at.shape[1],
                "corners": x.at.shape[2],
                "at": _shares(x.at[:1] if s or c is not None else x.at[kept], lo, hi),
                "moved": "" if c is None else _text(c[kept], "<f4"),
            }
            for x, s, c in zip(moving, still, carried, strict=True)
        ],
        "grounds": [line.tolist() for line in grounds(drawn)],
        "stopped": drawn.stopped,
        "energy": _energy(motion),
    }


def _forwards(kept: np.ndarray, ts: np.ndarray) -> np.ndarray:
    """Indices in the order of time; a motion may have been simulated backwards."""
    return kept[::-1] if ts[kept[-1]] < ts[kept[0]] else kept


def _is_still(at: np.ndarray, size: np.ndarray) -> bool:
    return bool((np.abs(at - at[:1]) <= _STILL * size.max()).all())


def _rigid_maps(at: np.ndarray, size: np.ndarray) -> np.ndarray | None:
    """(s, d + 1, d) linear maps and shifts from the first frame to each; None if there are none.

    Also None if they would take more bytes than the positions themselves.
    """
    frames, d = at.reshape(len(at), -1, at.shape[-1]), at.shape[-1]
    if 2 * (d + 1) * d > frames[0].size or not np.isfinite(frames).all():
        return None
    means = frames.mean(axis=1, keepdims=True)
    maps = np.linalg.pinv(frames[0] - means[0]) @ (frames - means)
    shifts = means - means[0] @ maps
    missed = np.abs(frames[0] @ maps + shifts - frames).max()
    return np.concatenate([maps, shifts], axis=1) if missed <= size.max() / _SHARES else None


def _energy(motion: Trajectory | HybridTrajectory) -> dict | None:
    """The energy at the start and its relative change; None for a scene without an energy."""
    good = [(piece, samples_reached(piece)) for piece in pieces_of(motion)]
    pieces = [dataclasses.replace(one, ts=one.ts[:n], ys=one.ys[:n]) for one, n in good if n]
    if not pieces or any(not _has_energy(piece) for piece in pieces):
        return None
    found = [change(piece.scene, piece.ts, piece.ys) for piece in pieces]
    ts = np.concatenate([np.asarray(piece.ts) for piece in pieces])
    values = np.concatenate([np.asarray(one.values) for one in found])
    size = max(float(one.size) for one in found)
    if not np.isfinite([*values, size]).all():
        return None
    kept = _forwards(np.unique(np.linspace(0, len(ts) - 1, _ENERGIES).astype(int)), ts)
    unit = pieces[0].scene.in_units("J")
    return {
        "start": float(values[0]),
        "size": size,
        "unit": f" {unit}" if unit else "",
        "ts": _text(ts[kept], "<f8"),
        "change": _text((values[kept] - values[0]) / size, "<f8"),
    }


def _has_energy(piece: Trajectory) -> bool:
    scene = piece.scene
    return bool(scene.system.energies(piece.ts[0], piece.ys[0], scene.effects))


def _shares(at: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> str:
    return _text(np.clip(np.rint((at - lo) / (hi - lo) * _SHARES), 0, _SHARES), "<u2")


def _text(array: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(array, kind).tobytes()).decode()
