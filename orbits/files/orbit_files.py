"""Orbit files, which hold an orbit with all that is claimed about it, written and read."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, overload

import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.files.codec import decode_fields, encode
from jaxdyn.files.digests import DAMAGED
from jaxdyn.files.layout import Layout, format_of
from orbits.analysis.evidence import closure
from orbits.analysis.report import Report, as_json, report
from orbits.families.family import Family
from orbits.files import encoding, family_files
from orbits.hybrid.legs import HybridOrbit, Leg
from orbits.hybrid.phases import Phases, legs_of
from orbits.hybrid.search import ReturnToStart, check_legs
from orbits.orbit import Orbit, Outcome
from orbits.proof.certificate import Certificate
from orbits.proof.refined import Refined

# ---- Files of chains of legs: their numbers with all that is claimed about them
#
# A file holds no functions, and so no events and changes: the legs, or the phases, are given again
# when it is read, and are refused if the chain does not close by them.

Closes = Callable[[Array, Array], Array]

CHAIN_LAYOUT = Layout("jaxdyn-chain", 1, "orbits.save")
#: Largest closing error of a chain by the legs that are given with its file.
_HOLDS = 1e-6


class ChainFile(NamedTuple):
    """The entries of a file besides its format and version.

    Attributes:
      path: see `HybridOrbit`.
      starts: starts of the legs.
      spans: spans of the legs.
      rtol: see `HybridOrbit`.
      claims: what is claimed about the chain.
    """

    path: list[tuple[str, int]]
    starts: list[list[float]]
    spans: list[float]
    rtol: float
    claims: dict


def _save_chain(path: str | Path, orbit: HybridOrbit, claims: Report | None) -> None:
    """See `orbits.save`."""
    known = ChainFile(
        path=list(orbit.path),
        starts=[np.asarray(leg.scene.y0).tolist() for leg in orbit.legs],
        spans=orbit.spans.tolist(),
        rtol=float(orbit.rtol),
        claims=as_json(report(orbit) if claims is None else claims),
    )
    CHAIN_LAYOUT.write(path, encode(known))


def _load_chain(
    path: str | Path, legs: Sequence[Leg] | Phases, closes: Closes | None
) -> tuple[HybridOrbit, dict[str, Any]]:
    """See `orbits.load`."""
    known = ChainFile(**decode_fields(CHAIN_LAYOUT.read(path), ChainFile, "file", DAMAGED))
    given = legs_of(legs, tuple(known.path))
    check_legs(given)
    sizes = [len(leg.scene.labels()) for leg in given]
    stored = [len(start) for start in known.starts]
    if stored != sizes or len(known.spans) != len(given):
        wanted = f"{len(stored)} legs of states with {stored} entries, those of the file"
        raise fail("legs", wanted, f"{len(given)} of {sizes}", "Files hold no functions.")
    numbers = np.concatenate([*known.starts, known.spans])
    if not (np.isfinite(numbers).all() and min(known.spans) > 0 and 0 < known.rtol < 1):
        raise fail("file", "finite starts, spans > 0 and 0 < rtol < 1", "others", DAMAGED)
    found = HybridOrbit(
        legs=tuple(
            dataclasses.replace(leg, scene=leg.scene.starting(np.array(start), span))
            for leg, start, span in zip(given, known.starts, known.spans, strict=True)
        ),
        closes=ReturnToStart(given[0].scene) if closes is None else closes,
        residual=math.nan,
        outcome=Outcome.FOUND,
        iterations=0,
        rtol=known.rtol,
        path=tuple(known.path),
    )
    off = closure(found)
    if not off <= _HOLDS:
        got = f"others, by which the chain misses its closing by {off:.1e}"
        raise fail("legs", "the legs or phases of the file, and its `closes`", got, DAMAGED)
    return found, known.claims


# ---- Orbit files: an orbit with all that is claimed about it, written and read

LAYOUT = Layout("jaxdyn-orbit", 5, "--save, or orbits.save,", {4: False})
#: Names of the claims of more digits and of a proof, where a file has them.
REFINED, CERTIFICATE = "refined", "certificate"


def save(
    path: str | Path,
    orbit: Orbit | HybridOrbit | Refined | Certificate | Family,
    claims: Report | None = None,
) -> None:
    """Write an orbit with all claims about it, or a family of orbits, atomically.

    Args:
      path: path of the JSON file.
      orbit: what `find`, `find_hybrid`, `refine` or `prove` returned; the digits or the certificate
        are claims. Files hold no functions: of a chain of legs, and of a scene with functions such
        as `jaxdyn.ode`, they have the numbers. Or a family, as `continue_family` returns it.
      claims: the report about the orbit; made here by default. Families have none.
    Raises:
      ValueError: `orbit` is something else, or the folder does not exist.
    """
    if isinstance(orbit, Family):
        family_files.save(path, family_files.listing(orbit, family_files.parameter_name(orbit)))
        return
    if isinstance(orbit, HybridOrbit):
        _save_chain(path, orbit, claims)
        return
    if not isinstance(orbit, Orbit | Refined | Certificate):
        table = "Write its table: result.to_pandas().to_csv(path)."
        remedy = "The path comes first: orbits.save(path, orbit)."
        remedy = table if hasattr(orbit, "to_pandas") else remedy
        wanted = "an orbit, chain of legs, refined orbit, certificate or family"
        raise fail("orbit", wanted, type(orbit).__name__, remedy)
    more = {}
    if isinstance(orbit, Refined | Certificate):
        name = REFINED if isinstance(orbit, Refined) else CERTIFICATE
        orbit, more = orbit.orbit, {name: orbit.as_json()}
    claims = report(orbit) if claims is None else claims
    LAYOUT.write(path, encoding.encode_orbit(orbit) | {"claims": as_json(claims) | more})


@overload
def load(path: str | Path, *, scene: Scene | None = None) -> tuple[Orbit, dict[str, Any]]: ...
@overload
def load(
    path: str | Path, legs: Sequence[Leg] | Phases, *, closes: Closes | None = None
) -> tuple[HybridOrbit, dict[str, Any]]: ...
def load(path, legs=None, *, closes=None, scene=None):
    """The orbit in a file, and the file's claims about it.

    Args:
      path: path of the JSON file.
      legs: for a chain of legs, the legs or the phases that were given to `find_hybrid`, since its
        file has only numbers.
      closes: the closing of a chain, if one was given to `find_hybrid`.
      scene: for an orbit of a scene that holds functions, such as `jaxdyn.ode`, a scene with these
        functions; its numbers are replaced by those of the file. Not used for a scene that is in
        the file as a whole.
    Raises:
      ValueError: the file is not a readable orbit file of this version, its data is invalid, the
        chain does not close by these legs, or the equations are not those of `scene`.
    """
    if legs is not None:
        return _load_chain(path, legs, closes)
    if format_of(path, LAYOUT.remedy) == CHAIN_LAYOUT.format:
        remedy = "Give those of the search: orbits.load(path, legs)."
        raise fail("legs", "the legs or the phases of the chain in the file", "none", remedy)
    record = LAYOUT.read(path)
    claims = record.pop("claims", None)
    if not isinstance(claims, dict):
        raise fail("file", "claims by name", type(claims).__name__, DAMAGED)
    return encoding.decode_orbit(record, scene), claims
