"""The equations of motion near an equilibrium: M x'' + C x' + K x = 0 with symbols as entries."""

import numpy as np

from jaxdyn import _checks
from jaxdyn.symbolic.algebra import Atom, Expression, Symbol, number
from jaxdyn.symbolic.arranging import bracketed
from jaxdyn.symbolic.deriving import Derived
from jaxdyn.symbolic.simplifying import simplified
from jaxdyn.symbolic.typesetting import LATEX, MATHML, TEXT, Style

#: Largest force at an equilibrium, as a displacement relative to the coordinates.
_AT_REST = 1e-9


class Linear:
    """The linearised equations of motion, M x'' + C x' + K x = 0 of x = q - q0.

    Attributes:
      M: (n, n) expressions: the mass matrix.
      C: (n, n) of the velocities: damping and gyroscopic terms.
      K: (n, n) of the displacements.
      coordinates: (n) symbols of q.
      at: (n) their values q0.
    """

    def __init__(self, found: Derived, y: np.ndarray, values: dict[Symbol, float]):
        q = found.symbols.coordinates
        n = len(q)
        a = found.symbols.unknowns
        if found.multipliers or 2 * n != len(found.symbols.state):
            raise _checks.fail(
                "linearised",
                "a scene of free coordinates with accelerations",
                found.law,
                "jaxdyn.linearize has the Jacobian of every scene; a mechanism with constraints "
                'has free coordinates with formulation="newton_euler".',
            )
        v = found.symbols.state[n:]
        at: dict[Atom, Expression] = dict.fromkeys((*v, *a), number(0))
        at |= {s: number(float(x)) for s, x in zip(q, y[:n], strict=True)}
        _check_rest(found, y, at, values)
        self.coordinates, self.at = q, tuple(float(x) for x in y[:n])
        self.M, self.C, self.K = (
            [[_there(x.differentiated(s), at) for s in of] for x in found.equations]
            for of in (a, v, q)
        )
        self._values = values

    def matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """M, C and K (n, n) with the numbers of the scene."""
        m, c, k = (
            np.array([[x.value(self._values) for x in row] for row in part])
            for part in (self.M, self.C, self.K)
        )
        return m, c, k

    def text(self) -> str:
        """The matrices as plain text, one entry a line; those that are not there are 0."""
        lines = []
        for name, part in self._parts().items():
            for i, row in enumerate(part):
                for j, x in enumerate(row):
                    if x:
                        index = f"{i + 1}{j + 1}" if len(row) > 1 else ""
                        lines.append(f"{name}{index} = {TEXT.expression(x)}")
        return "\n".join(lines)

    def latex(self) -> str:
        """The matrices in LaTeX."""
        return " \\qquad ".join(self._in(LATEX))

    def mathml(self) -> str:
        """The matrices as MathML, a formula for each."""
        return "\n".join(f'<math display="block">{x}</math>' for x in self._in(MATHML))

    def _parts(self) -> dict[str, list[list[Expression]]]:
        parts = {"M": self.M, "C": self.C, "K": self.K}
        return {name: part for name, part in parts.items() if any(x for row in part for x in row)}

    def _in(self, style: Style) -> list[str]:
        return [
            style.relation(
                style.symbol(Symbol(name, "short")),
                "=",
                style.matrix([[style.expression(x) for x in row] for row in part]),
            )
            for name, part in self._parts().items()
        ]

    def _repr_latex_(self) -> str:
        return f"$$\n{self.latex()}\n$$"

    def __repr__(self) -> str:
        where = (f"{s} = {x:.12g}" for s, x in zip(self.coordinates, self.at, strict=True))
        return f"Linear: M x'' + C x' + K x = 0 at {', '.join(where)}\n{self.text()}"


def _there(x: Expression, at: dict[Atom, Expression]) -> Expression:
    return bracketed(simplified(x.replaced(at.get)))


def _check_rest(
    found: Derived, y: np.ndarray, at: dict[Atom, Expression], values: dict[Symbol, float]
) -> None:
    """Raise ValueError unless nothing moves, and nothing begins to."""
    q = found.symbols.coordinates
    timed = any(found.symbols.time in x.symbols() for x in found.equations)
    moving = bool(np.any(y[len(q) :] != 0))
    if not timed and not moving:
        for x in found.equations:
            left = x.replaced(at.get).value(values)
            stiffness = (x.differentiated(s).replaced(at.get).value(values) for s in q)
            sizes = 1 + np.abs(y[: len(q)])
            moving |= abs(left) > _AT_REST * sum(np.abs(list(stiffness)) * sizes)
    if timed or moving:
        raise _checks.fail(
            "linearised",
            "an equilibrium: a state at rest without accelerations",
            "equations that depend on time" if timed else f"{y.tolist()}",
            "jaxdyn.equilibria(scene) finds them.",
        )
