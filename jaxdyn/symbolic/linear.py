"""Derivatives of the equations of motion, with symbols as entries.

Near an equilibrium the equations are M x'' + C x' + K x = 0; the Jacobian of the rate is valid at
any state.
"""

import math
from collections.abc import Mapping

import numpy as np

from jaxdyn import _checks
from jaxdyn.symbolic.algebra import Atom, Expression, Symbol, as_expression, number
from jaxdyn.symbolic.arranging import Lengths, collect, factor_common, factor_shared
from jaxdyn.symbolic.deriving import DerivedEquations
from jaxdyn.symbolic.matrices import Matrices, Rows
from jaxdyn.symbolic.simplifying import simplify

#: Largest force at an equilibrium, expressed as a displacement relative to the coordinates.
_AT_REST = 1e-9


class Linear(Matrices):
    """The linearised equations of motion, M x'' + C x' + K x = 0 of x = q - q0.

    Attributes:
      rows: rows of M, of C (damping and gyroscopic terms) and of K, (n, n) expressions each.
      coordinates: (n) symbols of q.
      at: (n) their values q0.
    """

    def __init__(self, found: DerivedEquations, y: np.ndarray, values: dict[Symbol, float]):
        q = found.symbols.coordinates
        n = len(q)
        a = found.symbols.unknowns
        if found.multipliers or 2 * n != len(found.symbols.state):
            raise _checks.fail(
                "linearize",
                "a scene of free coordinates with accelerations",
                found.law,
                "jaxdyn.linearize has the Jacobian of every scene; a mechanism with constraints "
                'has free coordinates with formulation="newton_euler".',
            )
        v = found.symbols.state[n:]
        at: dict[Atom, Expression] = dict.fromkeys((*v, *a), number(0))
        at |= {s: number(float(x)) for s, x in zip(q, y[:n], strict=True)}
        if found.followers:
            followers = found.followers.values(0.0, y)
            at |= {s: number(x) for s, x in followers.items()}
            for s, x in found.followers.definitions:
                at[s] = x.replace(at.get)
        _check_rest(found, y, at, values)
        self.coordinates, self.at = q, tuple(float(x) for x in y[:n])
        self._values = values
        slopes = {
            name: [[found.slope(x, s).replace(at.get) for s in of] for x in found.equations]
            for name, of in (("M", a), ("C", v), ("K", q))
        }
        super().__init__({name: _in_print(rows) for name, rows in slopes.items()})

    def matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """M, C and K, each (n, n), with the parameters of the scene."""
        m, c, k = self.values(self._values)
        return m, c, k

    def __repr__(self) -> str:
        where = (f"{s} = {x:.12g}" for s, x in zip(self.coordinates, self.at, strict=True))
        return f"Linear: M x'' + C x' + K x = 0 at {', '.join(where)}\n{self.text()}"


def jacobian(found: DerivedEquations, short: Lengths) -> Matrices:
    """The derivatives of the rate with respect to the state, with names for lengths.

    Raises:
      ValueError: an equation contains more than one highest derivative.
    """
    symbols = found.symbols
    solved: dict[Symbol, Expression] = {}
    for whole in found.equations:
        own = {s: whole.differentiate(s) for s in (*symbols.unknowns, *found.multipliers)}
        own = {s: x for s, x in own.items() if x}
        if len(own) == 1:
            ((s, x),) = own.items()
            if len(x.terms) == 1 and not found.multipliers and not found.followers:
                solved[s] = as_expression(s) - whole / x
    if set(solved) != set(symbols.unknowns):
        raise _checks.fail(
            "jacobian",
            "equations each with one derivative",
            found.law,
            "jaxdyn.linearize has the Jacobian of every scene in numbers.",
        )
    rates = [solved.get(s, as_expression(s)) for s in symbols.rates]
    slopes = [[x.differentiate(s) for s in symbols.state] for x in rates]
    rows = [[factor_shared(_shortest(x, short)) for x in row] for row in slopes]
    return Matrices({"J": rows}, [(s, collect(x)) for s, x in short.definitions])


def _shortest(x: Expression, short: Lengths) -> Expression:
    """The form with the fewest terms, as it is or over common denominators."""
    return min((short(x), short(simplify(x))), key=lambda form: len(form.terms))


def _in_print(rows: Rows) -> Rows:
    return [[factor_common(simplify(x)) for x in row] for row in rows]


def _number(x: Expression, values: Mapping[Symbol, float]) -> float:
    """The value of an expression, NaN where it has none."""
    try:
        return float(x.value(values))
    except (ArithmeticError, ValueError):  # 1 / 0, log 0
        return math.nan


def _check_rest(
    found: DerivedEquations, y: np.ndarray, at: dict[Atom, Expression], values: dict[Symbol, float]
) -> None:
    """Raise ValueError unless nothing moves and all accelerations vanish."""
    q = found.symbols.coordinates
    timed = any(found.symbols.time in x.symbols() for x in found.equations)
    moving = bool(np.any(y[len(q) :] != 0))
    if not timed and not moving:
        for x in found.equations:
            left = _number(x.replace(at.get), values)
            stiffness = [_number(found.slope(x, s).replace(at.get), values) for s in q]
            if not np.isfinite([left, *stiffness]).all():
                raise _checks.fail(
                    "linearize",
                    "a state at which the forces have derivatives",
                    f"{y.tolist()}, where two points meet or a spring has no direction",
                    "jaxdyn.equilibria(scene, low, high) finds the equilibria.",
                )
            sizes = 1 + np.abs(y[: len(q)])
            moving |= abs(left) > _AT_REST * sum(np.abs(stiffness) * sizes)
    if timed or moving:
        raise _checks.fail(
            "linearize",
            "an equilibrium: a state at rest without accelerations",
            "equations that depend on time" if timed else f"{y.tolist()}",
            "jaxdyn.equilibria(scene) finds them.",
        )
