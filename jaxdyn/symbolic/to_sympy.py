"""Conversion of expressions to SymPy, which is optional."""

import importlib
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from jaxdyn import _checks
from jaxdyn.symbolic.algebra import PI, Atom, Call, Expression, Group, Symbol
from jaxdyn.symbolic.symbols import Symbols


class ToSympy:
    """Conversion of expressions to SymPy.

    Coordinates are functions of the symbol t, velocities their derivatives.

    Args:
      found: the symbols of a scene.
      lengths: the definitions of symbols that have one.
    Raises:
      ValueError: SymPy is not installed.
    """

    def __init__(self, found: Symbols, lengths: Mapping[Symbol, Expression]):
        try:
            self._sympy: Any = importlib.import_module("sympy")
        except ImportError as error:
            remedy = "Install it: pip install 'jaxdyn[equations]'."
            raise _checks.fail("sympy", "the package sympy", "none", remedy) from error
        self._t = t = self._sympy.Symbol("t")
        self._known: dict[Symbol, Any] = {found.time: t, PI: self._sympy.pi}
        for s in found.state:
            if s.dots == 0:
                self._known[s] = self._sympy.Function(s.name)(t)
        for s, rate in zip(found.state, found.rates, strict=True):
            self._known.setdefault(rate, self._known[s].diff(t))
        for s, x in lengths.items():
            self._known[s] = self(x)

    def equation(self, left: Expression, right: Expression) -> Any:
        """The equation left = right."""
        return self._sympy.Eq(self(left), self(right))

    def __call__(self, x: Expression) -> Any:
        """An expression."""
        terms = []
        for m, c in x.terms.items():
            factors = [self._atom(a) ** self._number(e) for a, e in m]
            terms.append(self._sympy.Mul(self._number(c), *factors))
        return self._sympy.Add(*terms)

    def _number(self, c: Fraction | float) -> Any:
        if isinstance(c, Fraction):
            return self._sympy.Rational(c.numerator, c.denominator)
        return self._sympy.Float(c, 17)

    def _atom(self, a: Atom) -> Any:
        if isinstance(a, Symbol):
            if a not in self._known:
                if a.kind == "coordinate":  # one that follows from others
                    self._known[a] = self._sympy.Function(a.name)(self._t)
                    return self._known[a]
                # `positive=False` would mean that it is not positive.
                given = {"positive": True} if a.positive else {"real": True}
                self._known[a] = self._sympy.Symbol(a.name, **given)
            return self._known[a]
        if isinstance(a, Group):
            return self(a.sum)
        return self._call(a)

    def _call(self, a: Call) -> Any:
        args = [self(x) for x in a.args]
        if a.op == "select":
            which, yes, no = args
            return self._sympy.Piecewise((yes, which), (no, True))
        if a.op == "step":
            return self._sympy.Heaviside(args[0], 1)
        if a.op == "pow":
            return args[0] ** args[1]
        name = _NAMES.get(a.op, a.op)
        if not hasattr(self._sympy, name):
            remedy = "Its code may have it: jaxdyn.equations(scene).code('python')."
            raise _checks.fail("sympy", "functions that SymPy has", a.op, remedy)
        return getattr(self._sympy, name)(*args)


_NAMES = {
    **{"lt": "Lt", "le": "Le", "gt": "Gt", "ge": "Ge", "eq": "Eq", "ne": "Ne"},
    **{"and": "And", "or": "Or", "not": "Not", "abs": "Abs", "max": "Max", "min": "Min"},
    **{"ceil": "ceiling", "rem": "Mod"},
}
