"""Orbit files: write one with its claims, read it, and derive every claim again from scratch."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from jaxdyn import Scene, records
from jaxdyn._checks import fail
from orbits.problem import PLAIN, Closing, Orbit, Outcome
from orbits.report import Report, as_json, report

FORMAT = "jaxdyn-orbit"
VERSION = 1
#: A file's numbers and those derived again may differ by this, relative to their size.
AGREEMENT = 1e-9
#: An error that a file claims may turn out this much larger: it is rounding, not a number.
_ERROR_FACTOR = 100.0
_ERROR_FLOOR = 1e-12
_ERRORS = (
    "closure",
    "permutation_error",
    "return_error",
    "symplectic_defect",
    "determinant_defect",
    "recheck.closure",
)
_NOT_COMPARED = ("multiplier_bars", "recheck.tolerance")


@dataclasses.dataclass(frozen=True)
class Mismatch:
    """One claim of a file that does not hold."""

    name: str
    claimed: Any
    derived: Any


def save(path: str | Path, orbit: Orbit, claims: Report | None = None) -> None:
    """Write an orbit with all that is claimed of it, atomically.

    Args:
      path: of the JSON file.
      orbit: what `find` returned.
      claims: its report; made here if left out.
    Raises:
      ValueError: the folder does not exist, or the scene holds a function.
    """
    claims = report(orbit) if claims is None else claims
    closing = orbit.closing
    places = None if closing.places is None else list(closing.places)
    records.write(
        path,
        {
            "format": FORMAT,
            "version": VERSION,
            "scene": records.encode(orbit.scene),
            "closing": {"places": places, "parts": closing.parts, "name": closing.name},
            "rtol": float(orbit.rtol),
            "claims": as_json(claims),
        },
    )


def load(path: str | Path) -> tuple[Orbit, dict[str, Any]]:
    """The orbit in a file, and what the file claims of it.

    Raises:
      ValueError: not a readable orbit file of this version, or one that makes no sense.
    """
    record = records.read(path, FORMAT, VERSION)
    remedy = "The file was edited or is damaged."
    try:
        scene = records.decode(record["scene"], "scene")
        if not isinstance(scene, Scene):
            raise fail("scene", "a Scene", type(scene).__name__, remedy)
        scene.check()
        closing = _closing(record["closing"], len(scene.y0))
        rtol, claims = float(record["rtol"]), record["claims"]
        if not (0 < rtol < 1 and float(scene.t1) > 0 and isinstance(claims, dict)):
            raise fail("file", "a period > 0, 0 < rtol < 1 and claims", "others", remedy)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise fail("file", "a complete orbit", f"{type(error).__name__} {error}", remedy) from error
    orbit = Orbit(scene, closing, math.nan, Outcome.FOUND, 0, rtol)
    return orbit, claims


def verify(path: str | Path) -> tuple[Report, list[Mismatch]]:
    """All claims of an orbit file derived again, and those that do not hold.

    Raises:
      ValueError: see `load`.
    """
    orbit, claims = load(path)
    derived = report(orbit)
    return derived, list(_compare(claims, as_json(derived)))


def _closing(record: dict, k: int) -> Closing:
    places = record["places"]
    closing = Closing(None if places is None else tuple(places), record["parts"], record["name"])
    closing.check(k)
    return PLAIN if closing == PLAIN else closing


def _compare(claimed: Any, derived: Any, name: str = ""):
    if isinstance(derived, dict):
        if not isinstance(claimed, dict) or claimed.keys() != derived.keys():
            yield Mismatch(name or "claims", _keys(claimed), _keys(derived))
            return
        for key, value in derived.items():
            yield from _compare(claimed[key], value, f"{name}.{key}".lstrip("."))
    elif name not in _NOT_COMPARED and not _agrees(name, claimed, derived):
        yield Mismatch(name, claimed, derived)


def _agrees(name: str, claimed: Any, derived: Any) -> bool:
    if isinstance(derived, bool | str) or derived is None or claimed is None:
        return claimed is derived or (type(claimed) is type(derived) and claimed == derived)
    try:
        a, b = (np.array(x, dtype=float) for x in (claimed, derived))
    except (TypeError, ValueError):
        # Lists with None among the numbers.
        same_length = isinstance(claimed, list) and len(claimed) == len(derived)
        return same_length and all(map(_agrees, [name] * len(claimed), claimed, derived))
    if a.shape != b.shape or not np.isfinite(a).all():
        return False
    if name in _ERRORS:
        return bool(0 <= a and b <= max(_ERROR_FACTOR * a, _ERROR_FLOOR))
    return bool((np.abs(a - b) <= AGREEMENT * (1.0 + np.abs(b))).all())


def _keys(value: Any) -> Any:
    return sorted(value) if isinstance(value, dict) else type(value).__name__
