"""All claims about an orbit, in one record.

The command line prints it, files store it, and `orbits verify` recomputes it.
"""

import dataclasses
from typing import Any

import numpy as np

from jaxdyn._checks import check_first, fail
from jaxdyn._progress import report_progress
from jaxdyn._text import with_null
from jaxdyn.files.codec import decode
from jaxdyn.status import IntegrationError
from orbits.analysis.evidence import Recheck, closure, growth, recheck
from orbits.analysis.identity import has_normal_form, identify, normal_form
from orbits.analysis.pieces import Periodic
from orbits.analysis.same import minimal_period
from orbits.analysis.stability import stability
from orbits.analysis.words import has_word, word
from orbits.hybrid.legs import HybridOrbit
from orbits.orbit import Orbit

#: Consecutive periods simulated to show that an orbit returns.
PERIODS = 5


@dataclasses.dataclass(frozen=True)
class NormalForm:
    """Period and start of an orbit in the frame and scale of the printed eight."""

    period: float
    y0: list[float]


@dataclasses.dataclass(frozen=True)
class Report:
    """The claims about one orbit; field names as in the JSON output.

    Attributes:
      outcome: "FOUND", or why it is not an orbit.
      period: full period.
      y0: (k,) start, in the order of the system's labels.
      closure: largest difference between the state after one period and the start.
      growth: largest growth of a change on the way to the end of the period; times the unit of
        rounding, it is about the smallest closure that doubles allow.
      minimal_period: the shortest time after which the motion returns.
      choreography: whether all bodies follow one curve; None unless they are free points.
      permutation_error: deviation from a choreography; None where bodies differ.
      word: the free-group word of three bodies in the plane; None for anything else, and where
        the motion runs into a collision.
      energy: kinetic plus potential; None where it is not conserved.
      angular_momentum: about the origin; None where it is not conserved.
      scale_free: T |E|^(3/2) over G and the masses, see `Identity`; None unless all forces are
        Newtonian attractions.
      multipliers: all Floquet multipliers as [re, im].
      multiplier_bars: error bars of the non-trivial ones, which come first.
      exponents: rotation numbers of the non-trivial pairs; None for a real pair.
      unit_multipliers: number of multipliers that are 1 by an integral, a symmetry or the flow.
      verdict: "stable", "unstable" or "undecided".
      symplectic_defect: see `Stability`.
      determinant_defect: see `Stability`.
      periods_simulated: number of consecutive periods for `return_error`.
      return_error: largest difference between the state after these and the start.
      recheck: the closure by another integrator at a tighter tolerance.
      normal_form: period and start in normal form; None where there is none.
    """

    outcome: str
    period: float
    y0: list[float]
    closure: float
    growth: float
    minimal_period: float
    choreography: bool | None
    permutation_error: float | None
    word: str | None
    energy: float | None
    angular_momentum: float | None
    scale_free: float | None
    multipliers: list[list[float]]
    multiplier_bars: list[float]
    exponents: list[float | None]
    unit_multipliers: int
    verdict: str
    symplectic_defect: float | None
    determinant_defect: float | None
    periods_simulated: int
    return_error: float
    recheck: Recheck
    normal_form: NormalForm | None


@check_first
def report(orbit: Orbit | HybridOrbit) -> Report:
    """All claims about an orbit, computed from its scene, start and period alone.

    For a chain of legs they are computed from its legs and its closing.
    """
    report_progress("identifying the orbit")
    what = identify(orbit)
    report_progress("testing its stability")
    linear = stability(orbit, throw=False)
    form = None
    if isinstance(orbit, Orbit) and has_normal_form(orbit):
        normal = normal_form(orbit)
        form = NormalForm(normal.period, _floats(normal.y0))
    report_progress("simulating it again, by a second integrator too")
    return Report(
        outcome=orbit.outcome.name,
        period=orbit.period,
        y0=_floats(orbit.y0),
        closure=closure(orbit),
        growth=growth(orbit),
        minimal_period=minimal_period(orbit)[0],
        choreography=what.choreography,
        permutation_error=what.permutation_error,
        word=_word(orbit),
        energy=what.energy,
        angular_momentum=what.angular_momentum,
        scale_free=what.scale_free,
        multipliers=[[float(z.real), float(z.imag)] for z in linear.multipliers],
        multiplier_bars=_floats(linear.bars),
        exponents=list(linear.exponents),
        unit_multipliers=linear.unit,
        verdict=linear.verdict,
        symplectic_defect=linear.symplectic_defect,
        determinant_defect=linear.determinant_defect,
        periods_simulated=PERIODS,
        return_error=closure(orbit, periods=PERIODS),
        recheck=recheck(orbit),
        normal_form=form,
    )


def _word(orbit: Periodic) -> str | None:
    if isinstance(orbit, HybridOrbit):
        return None
    try:
        return word(orbit) if has_word(orbit) else None
    except IntegrationError:  # a motion into a collision has no word
        return None


@check_first
def as_json(claims: Report) -> dict[str, Any]:
    """The claims as a JSON object; numbers that are not finite become null."""
    return with_null(dataclasses.asdict(claims))


def from_json(record: Any, remedy: str) -> Report:
    """The claims in an object that `as_json` made; null becomes NaN where a number is expected.

    Args:
      record: the object, from a file.
      remedy: what to do if it holds no claims, for the message.
    Raises:
      ValueError: it has other entries than `as_json` writes, or some of another type.
    """
    found = decode(record, Report, "claims", remedy)
    pairs = all(len(z) == 2 for z in found.multipliers)
    if not (pairs and (found.normal_form is None or len(found.normal_form.y0) > 1)):
        raise fail("claims", "multipliers as pairs, and a start", "others", remedy)
    return found


def _floats(x) -> list[float]:
    return [float(value) for value in np.asarray(x)]
