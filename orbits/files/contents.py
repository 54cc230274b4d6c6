"""What a file claims to hold: an orbit with all that was found about it, or a family."""

import dataclasses
from pathlib import Path

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.files.digests import DAMAGED
from jaxdyn.files.layout import format_of
from orbits.analysis.report import Report, from_json
from orbits.files import family_files, orbit_files
from orbits.files.family_files import Listing
from orbits.orbit import Orbit
from orbits.proof.certificate import Certificate
from orbits.proof.refined import Refined


@dataclasses.dataclass(frozen=True)
class Claimed:
    """An orbit with what its file claims about it; `verify` recomputes that.

    Attributes:
      orbit: the orbit.
      report: the claims that every orbit file has.
      refined: the digits of the orbit, if there are more than doubles have.
      certificate: the proof of the orbit, if there is one.
    """

    orbit: Orbit
    report: Report
    refined: Refined | None
    certificate: Certificate | None


def contents(path: str | Path, scene: Scene | None = None) -> Claimed | Listing:
    """The orbit or the family in a file, with its claims, none of which is recomputed.

    Args:
      path: path of the JSON file.
      scene: see `orbits.load`.
    Raises:
      ValueError: it is neither an orbit file nor a family file of this version, or its data is
        invalid.
    """
    orbit, family = orbit_files.LAYOUT, family_files.LAYOUT
    found = format_of(path, orbit.remedy)
    if found == family.format:
        return family_files.load(path, scene)
    if found != orbit.format:
        wanted = f"format {orbit.format!r} or {family.format!r}"
        raise fail("file", wanted, repr(found)[:40], orbit.remedy)
    orbit, claims = orbit_files.load(path, scene=scene)
    refined, certificate = (
        claims.pop(name, None) for name in (orbit_files.REFINED, orbit_files.CERTIFICATE)
    )
    return Claimed(
        orbit=orbit,
        report=from_json(claims, DAMAGED),
        refined=None if refined is None else Refined.from_json(orbit, refined, DAMAGED),
        certificate=(
            None if certificate is None else Certificate.from_json(orbit, certificate, DAMAGED)
        ),
    )
