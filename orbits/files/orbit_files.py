"""Orbit files: an orbit with all that is claimed of it, written and read."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, overload

from jaxtyping import Array

from jaxdyn._checks import fail
from jaxdyn.files.digests import DAMAGED
from jaxdyn.files.layout import Layout, format_of
from orbits.analysis.report import Report, as_json, report
from orbits.files import chain_files, encoding
from orbits.hybrid.legs import HybridOrbit, Leg
from orbits.hybrid.phases import Phases
from orbits.orbit import Orbit
from orbits.proof.certificate import Certificate
from orbits.proof.refined import Refined

Closes = Callable[[Array, Array], Array]

LAYOUT = Layout("jaxdyn-orbit", 5, "--save, or orbits.save,", {4: False})
#: Claims of more digits and of a proof, where a file has them.
REFINED, CERTIFICATE = "refined", "certificate"


def save(
    path: str | Path,
    orbit: Orbit | HybridOrbit | Refined | Certificate,
    claims: Report | None = None,
) -> None:
    """Write an orbit with all claims about it, atomically.

    Args:
      path: of the JSON file.
      orbit: what `find`, `find_hybrid`, `refine` or `prove` returned; the digits or the certificate
        are claims. Of a chain of legs the file has the numbers only, since events and changes are
        functions.
      claims: its report; made here by default.
    Raises:
      ValueError: `orbit` is something else, the folder does not exist, or the scene holds a
        function.
    """
    if isinstance(orbit, HybridOrbit):
        chain_files.save(path, orbit, claims)
        return
    if not isinstance(orbit, Orbit | Refined | Certificate):
        remedy = "The path comes first: orbits.save(path, orbit)."
        wanted = "what orbits.find, find_hybrid, refine or prove returned"
        raise fail("orbit", wanted, type(orbit).__name__, remedy)
    more = {}
    if isinstance(orbit, Refined | Certificate):
        name = REFINED if isinstance(orbit, Refined) else CERTIFICATE
        orbit, more = orbit.orbit, {name: orbit.as_json()}
    claims = report(orbit) if claims is None else claims
    LAYOUT.write(path, encoding.encode_orbit(orbit) | {"claims": as_json(claims) | more})


@overload
def load(path: str | Path) -> tuple[Orbit, dict[str, Any]]: ...
@overload
def load(
    path: str | Path, legs: Sequence[Leg] | Phases, *, closes: Closes | None = None
) -> tuple[HybridOrbit, dict[str, Any]]: ...
def load(path, legs=None, *, closes=None):
    """The orbit in a file, and the file's claims about it.

    Args:
      path: of the JSON file.
      legs: of a chain of legs the legs or the phases that were given to `find_hybrid`: its file has
        numbers only.
      closes: likewise, if it was given.
    Raises:
      ValueError: not a readable orbit file of this version, its data is invalid, or the chain does
        not close by these legs.
    """
    if legs is not None:
        return chain_files.load(path, legs, closes)
    if format_of(path, LAYOUT.remedy) == chain_files.LAYOUT.format:
        remedy = "Give those of the search: orbits.load(path, legs)."
        raise fail("legs", "the legs or the phases of the chain in the file", "none", remedy)
    record = LAYOUT.read(path)
    claims = record.pop("claims", None)
    if not isinstance(claims, dict):
        raise fail("file", "claims by name", type(claims).__name__, DAMAGED)
    return encoding.decode_orbit(record), claims
