"""The conversion of an orbit to plain JSON and back, common to orbit files and family files."""

import math
from typing import Any, NamedTuple

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.files.codec import decode_fields, decode_part, decode_scene, encode, encode_scene
from jaxdyn.files.digests import DAMAGED
from orbits.closing.closings import Closing, Symmetry
from orbits.closing.given import check_drive, is_driven
from orbits.families.family import smooth_orbit
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit, Outcome

_WHOLE = 1e-9  # largest difference of the sum of a mesh's intervals from 1


class _Numbers(NamedTuple):
    """The fields of an orbit besides its scene and its closing (`Orbit`)."""

    angle: float
    rtol: float
    s_period: float | None
    mesh: tuple[float, ...] | None
    stiff: bool


_FIELDS = ("scene", "closing", *_Numbers._fields)


def encode_orbit(orbit: Orbit | HybridOrbit) -> dict[str, Any]:
    """The orbit as numbers, strings, lists and dictionaries.

    Raises:
      ValueError: the closing holds a function, or it is a chain of legs, which hold functions.
    """
    orbit = smooth_orbit("orbit", orbit)
    others = {name: encode(getattr(orbit, name)) for name in _FIELDS[1:]}
    return {"scene": encode_scene(orbit.scene)} | others


def decode_orbit(record: Any, given: Scene | None = None) -> Orbit:
    """The orbit of a record; whether it closes is not checked.

    Args:
      record: what `encode_orbit` returned.
      given: its scene, if that holds functions; see `decode_scene`.
    Raises:
      ValueError: the record is not of an orbit, or its data is invalid; or see `decode_scene`.
    """
    if not isinstance(record, dict) or record.keys() != {*_FIELDS}:
        got = sorted({*_FIELDS} ^ record.keys()) if isinstance(record, dict) else repr(record)[:40]
        raise fail("file", "a complete orbit", f"missing or extra {got}"[:80], DAMAGED)
    numbers = {name: record[name] for name in _Numbers._fields}
    known = _Numbers(**decode_fields(numbers, _Numbers, "file", DAMAGED))
    if not (known.s_period is None or 0 < known.s_period < math.inf):
        raise fail("file", "a span of logarithmic time > 0, or null", known.s_period, DAMAGED)
    mesh = known.mesh
    if not (mesh is None or (len(mesh) > 1 and min(mesh) > 0 and abs(sum(mesh) - 1) < _WHOLE)):
        raise fail("file", "lengths > 0 of intervals, of sum 1, or null", "others", DAMAGED)
    try:
        scene = decode_scene(record["scene"], DAMAGED, given)
        if not (0 < known.rtol < 1 and float(scene.t1) > 0 and math.isfinite(known.angle)):
            raise fail("file", "a period > 0 and 0 < rtol < 1", "others", DAMAGED)
        if is_driven(scene):
            check_drive(scene, float(scene.t1))
        closing = decode_part(record["closing"], Closing, "closing", (Symmetry,), DAMAGED)
        closing.check(scene)
    except (KeyError, TypeError, AttributeError, IndexError) as error:  # parts that fit no scene
        got = f"{type(error).__name__} {error}"[:80]
        raise fail("file", "a complete orbit", got, DAMAGED) from error
    return Orbit(
        scene=scene,
        closing=closing,
        residual=math.nan,
        outcome=Outcome.FOUND,
        iterations=0,
        **known._asdict(),
    )
