"""The record of a proof, or of why there is none; plain data, which files keep."""

import dataclasses
import math
import re
from typing import Any

from jaxdyn import _text
from jaxdyn._checks import fail
from jaxdyn.ball_arithmetic.enclosed import Enclosed
from jaxdyn.files.codec import decode_fields
from orbits.orbit import Orbit

#: Limits on what the check of a record has to calculate: `prove` needs less even for 1000 digits.
_LEAST_BITS, _MOST_BITS, _MOST_DIGITS = 2, 40_000, 1200.0
_NUMBER = re.compile(r"[0-9]+([.][0-9]+)?(e[+-]?[0-9]+)?")
_EXACT = re.compile(r"-?[0-9]{1,20000}\*2\^-?[0-9]{1,6}")
#: Fields that make claims about an orbit that is proved.
_CLAIMS = ("period", "y0", "multipliers", "exponents", "verdict", "verdict_proved", "choreography")


@dataclasses.dataclass(frozen=True)
class Certificate:
    """What is proved about an orbit.

    Attributes:
      orbit: the orbit in doubles.
      proved: whether a true periodic orbit is proved to exist within the enclosures below, and to
        be the only one within `radius` of their centre with the same held numbers.
      reason: the theorem's conditions in words, or what it lacks and what to try.
      bits: precision of the calculation.
      digits: decimal digits of the series.
      radius: radius of the box in which the orbit is unique, in units of each unknown.
      centre: the unknowns at the box's centre, exactly: mantissa and exponent of 2.
      names: names of the unknowns.
      held: numbers that keep the values they have in doubles, by name.
      period: the period.
      y0: (k) the start.
      multipliers: the non-trivial multipliers, as pairs of real and imaginary parts.
      exponents: rotation numbers of pairs on the unit circle.
      verdict: "stable", "unstable" or "undecided", linearly.
      verdict_proved: whether the enclosures prove it.
      choreography: True or False if proved, else None.
      units: units of the unknowns: sizes of entries of the start, a radian of the period, and 1 for
        an angle; all are powers of 2. All are 1 in records of earlier versions.
    """

    orbit: Orbit
    proved: bool
    reason: str
    bits: int
    digits: float
    radius: str
    centre: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    held: tuple[tuple[str, float], ...] = ()
    period: Enclosed | None = None
    y0: tuple[Enclosed, ...] = ()
    multipliers: tuple[tuple[Enclosed, Enclosed], ...] = ()
    exponents: tuple[Enclosed, ...] = ()
    verdict: str = "undecided"
    verdict_proved: bool = False
    choreography: bool | None = None
    units: tuple[float, ...] = ()

    @_text.never_raising
    def __repr__(self) -> str:
        called = _text.title_of(self.orbit.scene)
        if not self.proved:
            return _text.table(f"Not proved: orbit of {called}", [("reason", self.reason)])
        labels = self.orbit.scene.labels()
        rows = [
            ("exists", f"only one within {self.radius} of its sizes, {self.bits} bits"),
            ("held", ", ".join(f"{name} = {x!r}" for name, x in self.held)),
            ("period", str(self.period)),
            *((name, str(x)) for (name, _), x in zip(labels, self.y0, strict=True)),
            *(("multiplier", f"({a}) + ({b}) i") for a, b in self.multipliers),
            ("rotation", ", ".join(map(str, self.exponents))),
            ("stability", self._stability()),
            ("choreography", {True: "yes", False: "no", None: ""}[self.choreography]),
            ("by", self.reason),
        ]
        return _text.table(f"Proved: a periodic orbit of {called}", rows)

    _repr_html_ = _text.html

    def _stability(self) -> str:
        """What the multipliers prove, in words."""
        if not self.verdict_proved:
            return "not proved: multipliers are too close to each other, or to the circle"
        sizes = [_size(z) for z in self.multipliers]
        outside = sum(size - bar > 1 for size, bar in sizes)
        inside = sum(size + bar < 1 for size, bar in sizes)
        where = {"outside": outside, "inside": inside, "on": len(sizes) - outside - inside}
        if self.verdict == "unstable":
            where["not separated from"] = where.pop("on")
        places = ", ".join(f"{n} {place}" for place, n in where.items() if n)
        return f"linearly {self.verdict}" + (
            f": multipliers {places} the unit circle" if places else ""
        )

    def as_json(self) -> dict[str, Any]:
        """The certificate as a JSON object; numbers are decimal strings with a radius."""
        return {
            "proved": self.proved,
            "reason": self.reason,
            "bits": self.bits,
            "digits": self.digits,
            "radius": self.radius,
            "centre": list(self.centre),
            "names": list(self.names),
            "held": dict(self.held),
            "period": None if self.period is None else self.period.as_json(),
            "y0": [x.as_json() for x in self.y0],
            "multipliers": [{"re": a.as_json(), "im": b.as_json()} for a, b in self.multipliers],
            "exponents": [x.as_json() for x in self.exponents],
            "verdict": self.verdict,
            "verdict_proved": self.verdict_proved,
            "choreography": self.choreography,
            "units": list(self.units),
        }

    @classmethod
    def from_json(cls, orbit: Orbit, record: Any, remedy: str) -> "Certificate":
        """The certificate that `as_json` wrote; other records are a ValueError with the remedy."""
        try:
            pairs = [[z["re"], z["im"]] for z in record["multipliers"]]
            units = record.get("units", [1.0] * len(record["centre"]))
            held = [list(one) for one in record["held"].items()]
        except (KeyError, TypeError, AttributeError) as error:
            raise fail("certificate", "multipliers and held numbers", "others", remedy) from error
        plain = {**record, "multipliers": pairs, "held": held, "units": units}
        found = decode_fields(plain, cls, "certificate", remedy, without=("orbit",))
        if found["proved"] and (found["period"] is None or len(found["y0"]) != len(orbit.y0)):
            raise fail("certificate", "enclosures of the start and the period", "others", remedy)
        certificate = cls(orbit=orbit, **found)
        certificate.check(remedy)
        return certificate

    def check(self, remedy: str) -> None:
        """Raise ValueError, with the remedy, if `prove` cannot have made this certificate."""
        if not self.proved:
            nothing = Certificate(self.orbit, False, self.reason, self.bits, self.digits, "0")
            if any(getattr(self, name) != getattr(nothing, name) for name in _CLAIMS):
                raise fail("certificate", "no claims without a proof", "some", remedy)
            return
        if not _LEAST_BITS <= self.bits <= _MOST_BITS:
            raise fail("bits", f"{_LEAST_BITS} to {_MOST_BITS}", self.bits, remedy)
        if not 0 < self.digits <= _MOST_DIGITS:
            raise fail("digits", f"0 to {_MOST_DIGITS}", self.digits, remedy)
        if not (_NUMBER.fullmatch(self.radius) and 0 < float(self.radius) < math.inf):
            raise fail("radius", "a positive number", repr(self.radius)[:40], remedy)
        if len(self.units) != len(self.centre) or not all(0 < x < math.inf for x in self.units):
            raise fail("units", f"{len(self.centre)} positive numbers", self.units, remedy)
        for text in self.centre:
            if not _EXACT.fullmatch(text):
                raise fail("centre", "numbers like 3*2^-1", repr(text)[:40], remedy)


def _size(z: tuple[Enclosed, Enclosed]) -> tuple[float, float]:
    """The absolute value of a multiplier and a bound of its error, for words."""
    a, b = z
    rounding = 1e-12 * (1 + abs(float(a.mid)) + abs(float(b.mid)))
    return math.hypot(float(a.mid), float(b.mid)), float(a.rad) + float(b.rad) + rounding
