"""The check of records of digits and proofs, from the orbit and the record alone."""

from typing import Any

import numpy as np

from jaxdyn.ball_arithmetic.arithmetic import arb, precision
from orbits.orbit import Orbit
from orbits.proof.certificate import Certificate
from orbits.proof.closing_equations import ClosingEquations
from orbits.proof.posing import equations_of, sizes_of
from orbits.proof.proving import certify
from orbits.proof.refinement import refine

#: Numbers of a certificate that are enclosed, and those that are compared as they are.
_ENCLOSED = ("period", "y0", "multipliers", "exponents")
_SAME = ("proved", "reason", "names", "held", "verdict", "verdict_proved", "choreography")
_REMEDY = "orbits.prove makes certificates."
_BITS = 8000  # precision at which decimal strings of up to 1000 digits are compared


def refined_mismatch(orbit: Orbit, record: dict[str, Any]) -> str:
    """The first number of a refined orbit that is not reproduced; "" if all are."""
    again = refine(orbit, int(record["digits"])).as_json()
    allowed = arb(10) ** (2 - int(record["digits"]))
    # A period and an energy are their own sizes; multipliers and angles have the size 1.
    each = {"y0": sizes_of(orbit.scene).tolist(), "period": 0.0, "energy": 0.0}
    for name in ("period", "y0", "multipliers", "exponents", "angle", "energy"):
        if not _close(record[name], again[name], allowed, each.get(name, 1.0)):
            return name
    return "" if record["held"] == again["held"] else "held"


def certificate_mismatch(orbit: Orbit, record: dict[str, Any]) -> str:
    """The part of a certificate that is not proved again; "" if all is.

    The test runs on the box of the record's centre and radius with the record's bits. Each
    enclosure in the record must contain the one found now.

    Raises:
      ValueError: the record is not a certificate.
    """
    known = Certificate.from_json(orbit, record, _REMEDY)
    if not record["proved"]:
        return ""
    system = equations_of(orbit)
    if len(record["centre"]) != len(system.unknowns):
        return "centre"
    again = _prove_again(orbit, system, record, known.units)
    if not again.proved:
        return f"proved ({again.reason})"
    new = again.as_json()
    for name in _SAME:
        if new[name] != record[name]:
            return name
    return next((name for name in _ENCLOSED if not _contains(record[name], new[name])), "")


def _prove_again(
    orbit: Orbit, system: ClosingEquations, record: dict[str, Any], units: tuple[float, ...]
) -> Certificate:
    bits = int(record["bits"])
    with precision(bits):
        numbers = system.centre()
        for i, text in zip(system.unknowns, record["centre"], strict=True):
            mantissa, exponent = map(int, text.split("*2^"))
            numbers[i] = arb((mantissa, exponent))
    radius, digits = float(record["radius"]), float(record["digits"])
    return certify(orbit, system, numbers, radius, digits, bits=bits, units=np.array(units))


def _close(claimed: Any, derived: Any, allowed: arb, size: Any) -> bool:
    """Whether numbers agree, relative to the sum of their sizes and their absolute values."""
    if isinstance(derived, list):
        if not (isinstance(claimed, list) and len(claimed) == len(derived)):
            return False
        several = size if isinstance(size, list) else [size] * len(derived)
        pairs = zip(claimed, derived, several, strict=True)
        return all(_close(a, b, allowed, one) for a, b, one in pairs)
    if derived is None or claimed is None:
        return claimed is derived
    with precision(_BITS):
        a, b = arb(claimed), arb(derived)
        return bool(abs(a - b) <= allowed * (size + abs(b)))


def _contains(claimed: Any, derived: Any) -> bool:
    if isinstance(derived, list):
        same = isinstance(claimed, list) and len(claimed) == len(derived)
        return same and all(_contains(a, b) for a, b in zip(claimed, derived, strict=True))
    if isinstance(derived, dict) and "mid" not in derived:
        return all(_contains(claimed[key], derived[key]) for key in derived)
    if derived is None or claimed is None:
        return claimed is derived
    with precision(_BITS):
        gap = abs(arb(claimed["mid"]) - arb(derived["mid"])) + arb(derived["rad"])
        return bool(gap.mid() <= arb(claimed["rad"]).mid() * (1 + arb(2) ** -60))
