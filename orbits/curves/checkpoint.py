"""Curves of special orbits in a file: points written as JSON, and curves read from it."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxdyn._checks import fail
from jaxdyn._records import with_captures
from jaxdyn.continuation.branch import read
from jaxdyn.continuation.checkpoint import OTHER, Codec, SavedBranch, walks_in
from jaxdyn.continuation.kinds import Kind
from jaxdyn.files.codec import decode, decode_fields, decode_part, encode
from orbits.closing.closings import Return, Symmetry
from orbits.curves.curve import OrbitCurve, OrbitCurvePoint
from orbits.curves.extended import VECTORS, Extended, MakeOfTwo
from orbits.curves.steps import frame_at, orbit_of
from orbits.curves.units import equation_units, units_of, unknown_units

#: What the file of a continuation calls a curve of orbits.
ORBIT_CURVE = "curve of orbits"
_HOLDS = 1e-6  # largest relative closing error of an orbit that belongs to these scenes


def load(path: str | Path, make: MakeOfTwo) -> tuple[OrbitCurve, ...]:
    """The curves of special orbits in a file, which may still be being written.

    Args:
      path: path of the file that `orbits.continue_curve` wrote with ``path=``.
      make: (p, q) -> scene, as it was given to `orbits.continue_curve`: files hold only numbers.
    Returns:
      The curves, in order; for an interrupted run, what it had found.
    Raises:
      ValueError: the file is of another kind, was edited or damaged, or its orbits do not close in
        these scenes.
    """
    make = with_captures(make, "first", "second")
    walks, _ = walks_in(path, (ORBIT_CURVE,))
    return tuple(_curve(walk, make) for walk in walks)


def codec(extended: Extended) -> Codec:
    """The codec of points; the orbit of each follows from the unknowns of the equations."""

    def pack(point: OrbitCurvePoint) -> dict[str, Any]:
        orbit = point.orbit
        known = {"residual": float(orbit.residual), "iterations": int(orbit.iterations)}
        return encode(point, ("orbit",)) | {"orbit": known}

    def unpack(record: Any) -> OrbitCurvePoint:
        fields = decode_fields(record, OrbitCurvePoint, "file", OTHER, raw=("orbit",))
        if fields["unknowns"].shape != (extended.size,):
            got = f"shape {fields['unknowns'].shape}"
            raise fail("file", f"{extended.size} unknowns", got, OTHER)
        known = decode(fields["orbit"], _Closing, "file", OTHER)
        fields["orbit"] = orbit_of(extended, fields["unknowns"], *known)
        return OrbitCurvePoint(**fields)

    return Codec(pack, unpack)


def about(extended: Extended) -> dict[str, Any]:
    """The data, other than the scenes, that distinguish the equations of a curve from others."""
    return {
        "kind": str(extended.kind),
        "closing": encode(extended.closing),
        "driven": extended.driven,
        "segments": extended.segments,
        "k": extended.k,
        "rtol": float(extended.rtol),
    }


class _Closing(NamedTuple):
    """How an orbit was found."""

    residual: float
    iterations: int


class _About(NamedTuple):
    """The entries of `about`."""

    kind: Kind
    closing: dict
    driven: bool
    segments: int
    k: int
    rtol: float


def _curve(walk: SavedBranch, make: MakeOfTwo) -> OrbitCurve:
    known = decode(walk.begin.about, _About, "file", OTHER)
    closing = decode_part(known.closing, Return, "closing", (Symmetry,), OTHER)
    if known.kind not in VECTORS or known.segments < 1:
        raise fail("file", "a curve of special orbits", "another", OTHER)
    extended = Extended(make=make, **known._replace(closing=closing)._asdict())
    found = read(walk, codec(extended))
    for point in (found.members[0], found.members[-1]):
        _check(extended, point)
    return OrbitCurve(kind=known.kind, equations=extended, **found._asdict())


def _check(extended: Extended, point: OrbitCurvePoint) -> None:
    """Refuse scenes in which an orbit does not close."""
    along, x, units = np.zeros(len(extended.place)), point.unknowns, units_of(extended, point)
    try:
        frame = frame_at(extended, x, x[extended.place], along, units)
        # The vector has the length that the frame of its own point gave it.
        size = np.linalg.norm(extended.unpack(x).vectors[0][0] / units.each)
        residual = extended(x, frame._replace(rows=frame.rows / size))[0]
        residual = residual / equation_units(extended, units, len(residual))
    except (TypeError, ValueError, IndexError) as error:
        got = f"{type(error).__name__}: {error}"[:120]
        raise fail("make", "the scenes of the file", got, OTHER) from error
    worst = np.abs(residual).max()
    if not worst <= _HOLDS * (1.0 + np.abs(x / unknown_units(extended, units)).max()):
        got = f"others, in which an orbit misses its equations by {worst:.1e}"
        raise fail("make", "the scenes of the file", got, OTHER)
