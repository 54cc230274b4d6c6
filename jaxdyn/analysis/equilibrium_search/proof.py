"""The record of a proof that a list of equilibria is complete, or of what it leaves open."""

import dataclasses
from typing import Any

from jaxdyn import _text
from jaxdyn._text import number_of
from jaxdyn.ball_arithmetic.enclosed import Enclosed


@dataclasses.dataclass(frozen=True)
class EquilibriaProof:
    """All equilibria in a box, as a theorem.

    Attributes:
      proved: whether each box without one of `points` is proved to hold none.
      reason: the theorem in words, or what is left open.
      points: (e) enclosures (k) of one equilibrium each, which exists and is the only one there.
      undecided: boxes (k) that may hold others.
      discarded: number of boxes that are proved to hold none.
      names: (k) names of the entries of the state.
      bits: precision of the calculation.
    """

    proved: bool
    reason: str
    points: tuple[tuple[Enclosed, ...], ...]
    undecided: tuple[tuple[Enclosed, ...], ...]
    discarded: int
    names: tuple[str, ...]
    bits: int

    @_text.never_raising
    def __repr__(self) -> str:
        rows = [
            (f"{i + 1}", ", ".join(f"{n} = {x}" for n, x in zip(self.names, point, strict=True)))
            for i, point in enumerate(self.points)
        ]
        rows = [*_text.shorten(rows), ("boxes", f"{self.discarded} discarded"), ("by", self.reason)]
        count = number_of(len(self.points), "equilibrium", "equilibria")
        title = f"Proved: exactly {count}" if self.proved else f"Not proved: at least {count}"
        return _text.table(title, rows)

    _repr_html_ = _text.html

    def as_json(self) -> dict[str, Any]:
        """The proof as a JSON object; numbers are decimal strings with a radius."""

        def boxes(found: tuple) -> list:
            return [[x.as_json() for x in box] for box in found]

        return {
            "proved": self.proved,
            "reason": self.reason,
            "points": boxes(self.points),
            "undecided": boxes(self.undecided),
            "discarded": self.discarded,
            "names": list(self.names),
            "bits": self.bits,
        }
