"""Matrices with expressions as entries, for printing and evaluation."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxdyn.symbolic.algebra import Expression, Symbol
from jaxdyn.symbolic.typesetting import LATEX, MATHML, TEXT, Style

Rows = Sequence[Sequence[Expression]]


class Matrices:
    """Some matrices by name.

    Attributes:
      rows: the rows of each matrix, of expressions.
    """

    def __init__(self, rows: Mapping[str, Rows]):
        self.rows = dict(rows)

    def values(self, at: Mapping[Symbol, Any]) -> tuple[np.ndarray, ...]:
        """Each matrix with numbers in place of the symbols."""
        return tuple(
            np.array([[x.value(at) for x in row] for row in rows]) for rows in self.rows.values()
        )

    def text(self) -> str:
        """Plain text, one entry per line; entries that are left out are 0."""
        lines = []
        for name, rows in self.rows.items():
            for i, row in enumerate(rows):
                for j, x in enumerate(row):
                    if x:
                        index = f"{i + 1}{j + 1}" if len(row) > 1 else ""
                        lines.append(f"{name}{index} = {TEXT.expression(x)}")
        return "\n".join(lines)

    def latex(self) -> str:
        """LaTeX, for the inside of a displayed formula."""
        return " \\qquad ".join(self._in(LATEX))

    def mathml(self) -> str:
        """MathML, a formula for each."""
        return "\n".join(f'<math display="block">{x}</math>' for x in self._in(MATHML))

    def _in(self, style: Style) -> list[str]:
        return [
            style.relation(
                style.symbol(Symbol(name, "short")),
                "=",
                style.matrix([[style.expression(x) for x in row] for row in rows]),
            )
            for name, rows in self.rows.items()
            if any(x for row in rows for x in row)
        ]

    def _repr_markdown_(self) -> str:
        return f"$$\n{self.latex()}\n$$"

    def __repr__(self) -> str:
        return f"Matrices\n{self.text()}"
