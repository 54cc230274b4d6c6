"""An orbit as plain JSON, and back: the common part of orbit files and family files."""

from pathlib import Path
from typing import Any

from jaxdyn._checks import fail
from jaxdyn.files import records
from orbits.analysis.report import Report, as_json, report
from orbits.files import encoding
from orbits.orbit import Orbit

KEYS = {"scene", "closing", "angle", "rtol", "s_period"}
#: Modules of the classes that a file may name, looked up among those that are loaded.
LOADED = (effects, scenes)
#: Base classes of the parts of a scene.
KINDS = (System, Effect, Mechanism, Attitude, MaterialPoints, Looks, Angles)
DAMAGED = "The file was edited or damaged, or another version wrote it: make it again."


def save(path: str | Path, orbit: Orbit, claims: Report | None = None) -> None:
    """Write an orbit with all that is claimed of it, atomically.

    Args:
      path: of the JSON file.
      orbit: what `find` returned.
      claims: its report; made here if left out.
    Raises:
      ValueError: the folder does not exist, or the scene holds a function.
    """
    return {
        "scene": records.encode(orbit.scene),
        "closing": records.encode(orbit.closing),
        "angle": float(orbit.angle),
        "rtol": float(orbit.rtol),
        "s_period": orbit.s_period,
    }


def decode(record: dict[str, Any]) -> Orbit:
    """The orbit of a record; whether it closes is not checked.

    Raises:
      ValueError: the record is not of an orbit, or its data is invalid.
    """
    try:
        scene = _scene(record["scene"])
        closing = _closing(record["closing"], scene)
        angle, rtol, s_period = record["angle"], record["rtol"], record["s_period"]
        numbers = isinstance(angle, float | int) and isinstance(rtol, float | int)
        if not (s_period is None or (isinstance(s_period, float) and 0 < s_period < math.inf)):
            raise fail("file", "a span of logarithmic time > 0, or null", s_period, DAMAGED)
        if not (numbers and 0 < rtol < 1 and float(scene.t1) > 0 and math.isfinite(angle)):
            raise fail("file", "a period > 0 and 0 < rtol < 1", "others", DAMAGED)
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
    )


def load(path: str | Path) -> tuple[Orbit, dict[str, Any]]:
    """The orbit in a file, and what the file claims of it.

    Raises:
      ValueError: not a readable orbit file of this version, or one that makes no sense.
    """
    record = records.read(path, FORMAT, VERSION)
    if record.keys() != _KEYS:
        raise fail("file", f"the entries {sorted(_KEYS)}", sorted(record), encoding.DAMAGED)
    orbit, claims = encoding.decode(record), record["claims"]
    if not isinstance(claims, dict):
        raise fail("file", "claims by name", type(claims).__name__, encoding.DAMAGED)
    return orbit, claims
