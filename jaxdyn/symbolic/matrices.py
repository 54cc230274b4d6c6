"""Matrices with expressions as entries, for printing and evaluation."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxdyn.symbolic.algebra import Expression, Symbol
from jaxdyn.symbolic.typesetting import LATEX, MATHML, TEXT, Style

Rows = Sequence[Sequence[Expression]]


def index_of(n: int, *places: int) -> str:
    """The index of an entry of a matrix with n columns: "12", or "1,12" where that is unclear."""
    return ("," if n > _ONE_DIGIT else "").join(str(i + 1) for i in places)


_ONE_DIGIT = 9


class Matrices:
    """Some matrices by name.

    Attributes:
      rows: the rows of each matrix, of expressions.
      definitions: symbols for lengths in the entries, with the expressions that they stand for.
    """

    def __init__(
        self, rows: Mapping[str, Rows], definitions: Sequence[tuple[Symbol, Expression]] = ()
    ):
        self.rows = dict(rows)
        used = {s for of in rows.values() for row in of for x in row for s in x.symbols()}
        self.definitions = [(s, x) for s, x in definitions if s in used]

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
                        index = index_of(len(row), i, j) if len(row) > 1 else ""
                        lines.append(f"{name}{index} = {TEXT.expression(x)}")
        definitions = [f"{TEXT.symbol(s)} = {TEXT.expression(x)}" for s, x in self.definitions]
        return "\n".join([*lines, *(["with"] if definitions else []), *definitions])

    def latex(self) -> str:
        """LaTeX, for the inside of a displayed formula."""
        return " \\qquad ".join(self._in(LATEX))

    def mathml(self) -> str:
        """MathML, a formula for each."""
        return "\n".join(f'<math display="block">{x}</math>' for x in self._in(MATHML))

    def _in(self, style: Style) -> list[str]:
        matrices = [
            style.relation(
                style.symbol(Symbol(name, "short")),
                "=",
                style.matrix([[style.expression(x) for x in row] for row in rows]),
            )
            for name, rows in self.rows.items()
            if any(x for row in rows for x in row)
        ]
        return matrices + [
            style.relation(style.symbol(s), "=", style.expression(x)) for s, x in self.definitions
        ]

    def _repr_markdown_(self) -> str:
        return f"$$\n{self.latex()}\n$$"

    def __repr__(self) -> str:
        return f"Matrices\n{self.text()}"
