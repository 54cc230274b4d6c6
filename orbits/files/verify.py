"""Verification of an orbit file: every claim in it is recomputed from scratch."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.files.digests import DAMAGED
from orbits.analysis.evidence import after, closure
from orbits.analysis.pieces import Periodic, pieces
from orbits.analysis.report import Report, as_json, report
from orbits.closing.sizes import sizes
from orbits.files.orbit_files import CERTIFICATE, REFINED, Closes, load
from orbits.hybrid.legs import HybridOrbit, Leg
from orbits.hybrid.phases import Phases
from orbits.orbit import Orbit

#: A file's numbers and the recomputed ones may differ by this, relative to their size.
AGREEMENT = 1e-9
#: Claimed and recomputed errors may differ by this factor, since errors are mostly rounding.
_ERROR_FACTOR = 100.0
_ERROR_FLOOR = 1e-12
_ERRORS = (
    "closure",
    "growth",
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


def verify(
    path: str | Path,
    legs: Sequence[Leg] | Phases | None = None,
    *,
    closes: Closes | None = None,
    scene: Scene | None = None,
) -> tuple[Report, list[Mismatch]]:
    """All claims of an orbit file recomputed, and those that do not hold.

    Args:
      path: path of the JSON file.
      legs: see `load`.
      closes: see `load`.
      scene: see `load`.
    Raises:
      ValueError: see `load`; or the motion of the file's orbit ends before its period.
    """
    if legs is None:
        orbit, claims = load(path, scene=scene)
    else:
        orbit, claims = load(path, legs, closes=closes)
    if not np.isfinite(closure(orbit)):
        got = "one that ends before it"
        raise fail("file", "a motion that lasts for its period", got, DAMAGED)
    derived = report(orbit)
    proofs = {name: claims.pop(name) for name in (REFINED, CERTIFICATE) if name in claims}
    known = as_json(derived)
    compared = [*_compare(claims, known, _units(orbit, known))]
    if isinstance(orbit, HybridOrbit):
        return derived, [*_not_a_motion(orbit, derived), *compared]
    return derived, [*_not_closed(orbit, derived), *compared, *_compare_proofs(orbit, proofs)]


def _compare_proofs(orbit: Orbit, proofs: dict[str, Any]):
    """The claims of digits and of a proof that are not reproduced."""
    if not proofs:
        return
    # python-flint is needed for these claims alone.
    from orbits.proof import checking

    checks = {REFINED: checking.refined_mismatch, CERTIFICATE: checking.certificate_mismatch}
    for name, record in proofs.items():
        try:
            wrong = checks[name](orbit, record)
        except (KeyError, TypeError, AttributeError, ValueError, IndexError) as error:
            raise fail("file", f"a complete {name}", repr(error), DAMAGED) from error
        if wrong:
            yield Mismatch(f"{name}: {wrong}", "as in the file", "another")


def _not_a_motion(orbit: HybridOrbit, derived: Report):
    """The mismatches of a file whose chain does not close, or passes a bound."""
    if not derived.closure <= AGREEMENT:
        yield Mismatch("error of the closing", f"at most {AGREEMENT:.1e}", derived.closure)
    if not orbit.keeps_bounds:
        yield Mismatch("bounds of the legs", "kept", "passed")


def _not_closed(orbit: Orbit, derived: Report):
    """The mismatches of a file that truthfully describes a motion which is not an orbit."""
    end = after(orbit, 1 / orbit.closing.parts, rtol=orbit.rtol).y1
    system, y0, angle = orbit.scene.system, jnp.asarray(orbit.y0), jnp.asarray(orbit.angle)
    miss = np.asarray(orbit.closing.residual(system, end, y0, angle))
    miss, size = miss / orbit.closing.residual_units(sizes(orbit.scene)), AGREEMENT
    for name, error in (
        (orbit.closing.name, float(np.abs(miss).max())),
        ("plain closing", derived.closure),
    ):
        if not error <= size:
            yield Mismatch(f"error of the {name}", f"at most {size:.1e}", error)


def _units(orbit: Periodic, derived: Any) -> dict[str, Any]:
    """The sizes by which numbers with a unit are compared, by name; others are compared with 1."""
    energy = abs(derived["energy"] or 0.0)
    return {
        "period": orbit.period,
        "minimal_period": orbit.period,
        "y0": sizes(pieces(orbit)[0].scene).tolist(),
        "energy": energy,
        "angular_momentum": energy * orbit.period,
        "scale_free": abs(derived["scale_free"] or 0.0),
    }


def _compare(claimed: Any, derived: Any, units: dict[str, Any], name: str = ""):
    if isinstance(derived, dict):
        if not isinstance(claimed, dict) or claimed.keys() != derived.keys():
            yield Mismatch(name or "claims", _keys(claimed), _keys(derived))
            return
        for key, value in derived.items():
            yield from _compare(claimed[key], value, units, f"{name}.{key}".lstrip("."))
    elif name not in _NOT_COMPARED and not _agrees(name, claimed, derived, units.get(name, 1.0)):
        yield Mismatch(name, claimed, derived)


def _agrees(name: str, claimed: Any, derived: Any, unit: Any) -> bool:
    if isinstance(derived, list):
        n = len(derived)
        each = unit if isinstance(unit, list) else [unit] * n
        same_length = isinstance(claimed, list) and len(claimed) == n
        return same_length and all(map(_agrees, [name] * n, claimed, derived, each))
    if not (_is_number(claimed) and _is_number(derived)):
        return type(claimed) is type(derived) and claimed == derived
    if name in _ERRORS:
        small, large = sorted((claimed, derived))
        return 0 <= small and large <= max(_ERROR_FACTOR * small, _ERROR_FLOOR)
    return abs(claimed - derived) <= AGREEMENT * (unit + abs(derived))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _keys(value: Any) -> Any:
    return sorted(value) if isinstance(value, dict) else type(value).__name__
