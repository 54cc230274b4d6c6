"""Orbit files: an orbit with all that is claimed of it, written and read."""

from pathlib import Path
from typing import Any

from jaxdyn._checks import fail
from jaxdyn.files import records
from jaxdyn.files.digests import DAMAGED
from orbits.analysis.report import Report, as_json, report
from orbits.files import encoding
from orbits.orbit import Orbit
from orbits.proof.certificate import Certificate
from orbits.proof.refined import Refined

FORMAT = "jaxdyn-orbit"
VERSION = 5
_OLDER = {4: False}
#: Claims of more digits and of a proof, where a file has them.
REFINED, CERTIFICATE = "refined", "certificate"
_KEYS = {"format", "version", "claims"} | encoding.KEYS


def save(
    path: str | Path, orbit: Orbit | Refined | Certificate, claims: Report | None = None
) -> None:
    """Write an orbit with all claims about it, atomically.

    Args:
      path: of the JSON file.
      orbit: what `find`, `refine` or `prove` returned; the digits or the certificate are claims.
      claims: its report; made here by default.
    Raises:
      ValueError: `orbit` is something else, the folder does not exist, or the scene holds a
        function.
    """
    if not isinstance(orbit, Orbit | Refined | Certificate):
        remedy = "The path comes first: orbits.save(path, orbit)."
        wanted = "what orbits.find, refine or prove returned"
        raise fail("orbit", wanted, type(orbit).__name__, remedy)
    more = {}
    if isinstance(orbit, Refined | Certificate):
        name = REFINED if isinstance(orbit, Refined) else CERTIFICATE
        orbit, more = orbit.orbit, {name: orbit.as_json()}
    claims = report(orbit) if claims is None else claims
    records.write(
        path,
        {
            "format": FORMAT,
            "version": VERSION,
            **encoding.encode(orbit),
            "claims": as_json(claims) | more,
        },
    )


def load(path: str | Path) -> tuple[Orbit, dict[str, Any]]:
    """The orbit in a file, and the file's claims about it.

    Raises:
      ValueError: not a readable orbit file of this version, or its data is invalid.
    """
    record = records.read(path, FORMAT, VERSION, _OLDER)
    if record.keys() != _KEYS:
        raise fail("file", f"the entries {sorted(_KEYS)}", sorted(record), DAMAGED)
    orbit, claims = encoding.decode(record), record["claims"]
    if not isinstance(claims, dict):
        raise fail("file", "claims by name", type(claims).__name__, DAMAGED)
    return orbit, claims
