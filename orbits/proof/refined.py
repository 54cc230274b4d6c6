"""The record of an orbit to many digits; plain data, which files keep without python-flint."""

import dataclasses
from typing import Any

import numpy as np

from jaxdyn import _text
from jaxdyn._checks import fail
from jaxdyn.analysis.eigenvalues import Eigenvalues, map_verdict
from jaxdyn.files.codec import decode_fields
from orbits.analysis.stability import Stability, rotation_numbers, stability
from orbits.orbit import Orbit

_SPARE = 3  # digits that multipliers may have lost
_SPARE_NEAR = 6  # likewise for two that nearly meet, besides the digits of their distance
#: Distance of two multipliers below which errors of the matrix change them by more than its digits
#: suggest.
NEAR = 1e-3
_ROUNDING = 1e-15  # rounding of multipliers as doubles, with some to spare


@dataclasses.dataclass(frozen=True)
class Refined:
    """An orbit to many digits.

    Attributes:
      orbit: the orbit in doubles that it refines.
      digits: certain decimal digits after the leading one of each number; for `y0`, after the
        leading one of each entry's size along the motion.
      period: the full period.
      y0: (k) the start.
      held: names of the numbers that keep the values they have in doubles, which select the orbit
        among its neighbours.
      residual: the closing error that a second run with other orders and steps finds, in the sizes
        of the entries.
      multipliers: (p) the non-trivial Floquet multipliers, as (real, imaginary) parts; with fewer
        digits where two nearly meet.
      exponents: rotation numbers in (0, 1/2) of pairs of them on the unit circle; None for a pair
        elsewhere.
      energy: kinetic plus potential; None where it is not conserved.
      angle: rotation of a relative orbit after one part of its period, else None.
    """

    orbit: Orbit
    digits: int
    period: str
    y0: tuple[str, ...]
    held: tuple[str, ...]
    residual: str
    multipliers: tuple[tuple[str, str], ...]
    exponents: tuple[str | None, ...]
    energy: str | None = None
    angle: str | None = None

    @_text.never_raising
    def __repr__(self) -> str:
        labels = self.orbit.scene.labels()
        rows = [
            ("period", self.period),
            *((name, x) for (name, _), x in zip(labels, self.y0, strict=True)),
            ("angle", self.angle or ""),
            ("rotation", ", ".join(x for x in self.exponents if x)),
            ("held", ", ".join(self.held)),
            ("closes", f"to {self.residual}"),
        ]
        return _text.table(
            f"Orbit of {_text.title_of(self.orbit.scene)} to {self.digits} digits", rows
        )

    _repr_html_ = _text.html

    def stability(self) -> Stability:
        """The linear stability by these multipliers, where those in doubles leave it undecided.

        Their bars follow from the digits, and are at least the rounding of doubles. All else in the
        record is from the orbit in doubles. Where the number of multipliers that are 1 is not that
        of the theory, the verdict is "undecided".
        """
        rough = stability(self.orbit, throw=False)
        values = np.array([complex(*map(float, z)) for z in self.multipliers])
        apart = np.abs(values[:, None] - values[None]) + np.eye(len(values))
        apart = np.minimum(apart.min(axis=1, initial=1.0), 1.0)
        with np.errstate(divide="ignore"):  # two that are the same double have infinite bars
            lost = np.where(apart < NEAR, _SPARE_NEAR - np.log10(apart), _SPARE)
        bars = np.maximum(10.0 ** (lost - self.digits), _ROUNDING)
        found = Eigenvalues(values, bars * np.maximum(1.0, np.abs(values)))
        alike = len(values) == len(rough.nontrivial)
        known = rough.multipliers[len(rough.nontrivial) :]
        return dataclasses.replace(
            rough,
            multipliers=np.concatenate([values, known]) if alike else rough.multipliers,
            nontrivial=found.values,
            bars=found.bars,
            exponents=rotation_numbers(*found),
            verdict=str(map_verdict(found, rough.conservative)) if alike else "undecided",
        )

    def as_json(self) -> dict[str, Any]:
        """The numbers as a JSON object."""
        return {
            "digits": self.digits,
            "period": self.period,
            "y0": list(self.y0),
            "angle": self.angle,
            "held": list(self.held),
            "residual": self.residual,
            "energy": self.energy,
            "multipliers": [list(z) for z in self.multipliers],
            "exponents": list(self.exponents),
        }

    @classmethod
    def from_json(cls, orbit: Orbit, record: Any, remedy: str) -> "Refined":
        """The orbit that `as_json` wrote; other records are a ValueError with the remedy."""
        found = decode_fields(record, cls, "refined", remedy, without=("orbit",))
        if len(found["y0"]) != len(orbit.y0):
            raise fail("refined", f"{len(orbit.y0)} numbers of the start", len(found["y0"]), remedy)
        return cls(orbit=orbit, **found)
