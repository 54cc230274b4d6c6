"""An orbit as plain JSON, and back: the common part of orbit files and family files."""

import math
from typing import Any

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.files import records, scene_records
from jaxdyn.files.digests import DAMAGED
from orbits.closing.closings import Closing
from orbits.closing.given import check_drive, driven
from orbits.closing.symmetry import Symmetry
from orbits.families.family import smooth_orbit
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit, Outcome

KEYS = {"scene", "closing", "angle", "rtol", "s_period", "mesh", "stiff"}
_WHOLE = 1e-9  # largest difference of the sum of a mesh's intervals from 1


def encode(orbit: Orbit | HybridOrbit) -> dict[str, Any]:
    """The orbit as numbers, strings, lists and dictionaries.

    Raises:
      ValueError: the scene holds a function, or it is a chain of legs, which hold some.
    """
    orbit = smooth_orbit("orbit", orbit)
    return {
        "scene": records.encode(orbit.scene),
        "closing": records.encode(orbit.closing),
        "angle": float(orbit.angle),
        "rtol": float(orbit.rtol),
        "s_period": orbit.s_period,
        "mesh": None if orbit.mesh is None else list(orbit.mesh),
        "stiff": orbit.stiff,
    }


def decode(record: dict[str, Any]) -> Orbit:
    """The orbit of a record; whether it closes is not checked.

    Raises:
      ValueError: the record is not of an orbit, or its data is invalid.
    """
    try:
        scene = _scene(record["scene"])
        angle, rtol, s_period = record["angle"], record["rtol"], record["s_period"]
        numbers = isinstance(angle, float | int) and isinstance(rtol, float | int)
        if not (s_period is None or (isinstance(s_period, float) and 0 < s_period < math.inf)):
            raise fail("file", "a span of logarithmic time > 0, or null", s_period, DAMAGED)
        mesh, stiff = _mesh(record["mesh"]), record["stiff"]
        if not isinstance(stiff, bool):
            raise fail("file", "true or false for `stiff`", stiff, DAMAGED)
        if not (numbers and 0 < rtol < 1 and float(scene.t1) > 0 and math.isfinite(angle)):
            raise fail("file", "a period > 0 and 0 < rtol < 1", "others", DAMAGED)
        closing = _closing(record["closing"], scene)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        got = f"{type(error).__name__} {error}"
        raise fail("file", "a complete orbit", got, DAMAGED) from error
    return Orbit(
        scene=scene,
        closing=closing,
        residual=math.nan,
        outcome=Outcome.FOUND,
        iterations=0,
        rtol=float(rtol),
        angle=float(angle),
        s_period=s_period,
        mesh=mesh,
        stiff=stiff,
    )


def _mesh(record: Any) -> tuple[float, ...] | None:
    if record is None:
        return None
    shares = tuple(record) if isinstance(record, list) else ()
    valid = len(shares) > 1 and all(isinstance(share, float) and share > 0 for share in shares)
    if not (valid and abs(sum(shares) - 1) < _WHOLE):
        raise fail("file", "lengths > 0 of intervals, of sum 1, or null", "others", DAMAGED)
    return shares


def _scene(record: Any) -> Scene:
    scene = scene_records.decode(record, DAMAGED)
    if driven(scene):
        check_drive(scene, float(scene.t1))
    return scene


def _closing(record: Any, scene: Scene) -> Closing:
    closing = records.decode(record, "closing", (Closing, Symmetry))
    if not (isinstance(closing, Closing) and isinstance(closing.name, str)):
        raise fail("closing", "a closing condition with a name", "others")
    closing.check(scene)
    return closing
