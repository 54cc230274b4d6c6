"""Proofs of identities between formulas: that an integral is conserved, that a symmetry is one.

Formulas become polynomials with rational coefficients (a float is a rational number) in the inputs
and in one generator for each function of them: a root, quotient or power of a polynomial a is a
power of s with s^2 a = 1; a sine and a cosine satisfy S^2 + C^2 = 1. A polynomial that vanishes
after these reductions is an identity; one that does not vanish proves nothing.

Formulas may have another case where a quantity, such as a distance, is exactly 0. Identities hold
in the case that it is not, which `apart` names: an enclosure of the motion must have excluded the
other case.
"""

import dataclasses
import math
from fractions import Fraction
from typing import Any

from flint import fmpq, fmpq_mpoly_ctx

from jaxdyn.ball_arithmetic.program import Program
from jaxdyn.solvers.formulas.graph import LOGIC, Node, Number

#: Number of generators for functions; with more functions nothing is proved.
_MOST_FUNCTIONS = 120
#: Terms of a polynomial beyond which nothing is proved.
_MOST_TERMS = 20_000
_MOST_HALVES = 8  # denominators are recognised as powers a^(n/2) with n below this


class NoPolynomial(ArithmeticError):
    """Raised if a formula is not a polynomial in inputs and functions; names the operation."""


@dataclasses.dataclass(eq=False)
class Polynomials:
    """The ring of polynomials in some inputs and in functions of them.

    Args:
      inputs: nodes that are variables.
      apart: comparisons of two numbers that are known to be different.
    """

    inputs: list[Node]
    apart: frozenset[Node] = frozenset()
    _roots: list[tuple[Any, Any]] = dataclasses.field(default_factory=list)
    _functions: dict[tuple, Any] = dataclasses.field(default_factory=dict)
    _sines: list[tuple[int, int]] = dataclasses.field(default_factory=list)
    _used: int = 0

    def __post_init__(self):
        count = len(self.inputs) + _MOST_FUNCTIONS
        self.context = fmpq_mpoly_ctx.get([f"x{i}" for i in range(count)], "lex")
        self.generators = self.context.gens()
        self._used = len(self.inputs)

    def constant(self, x: float | Fraction):
        """The polynomial of a known number."""
        if not math.isfinite(x):
            raise NoPolynomial(str(x))
        value = Fraction(x)
        return self.context.constant(fmpq(int(value.numerator), int(value.denominator)))

    def values(self, program: Program, variables: list) -> list:
        """The results of a program at polynomials for its inputs.

        Raises:
          NoPolynomial: an operation is not representable.
        """
        found: dict[Node, Any] = dict(zip(self.inputs, variables, strict=True))
        for node in program.nodes:
            if node not in found:
                try:
                    found[node] = self._value(node, found)
                except NoPolynomial as error:  # it is raised where the node is needed
                    found[node] = error
        return [self._at(r, found) for r in program.results]

    def vanishes(self, p) -> bool:
        """Whether a polynomial is proved to be zero."""
        for s, c in self._sines:
            p = self._without_square(p, s, 1 - self.generators[c] ** 2)
        return self._vanishes(p, len(self._roots))

    def _vanishes(self, p, roots: int) -> bool:
        if p.is_zero():
            return True
        if not roots:
            return False
        a, s = self._roots[roots - 1]
        # p = sum of s^j p_j; with s^-2 = a, its even and odd parts vanish separately or not at all.
        parts = self._by_power(p, s)
        highest = max(parts)
        for parity in (0, 1):
            total = self.constant(0)
            for j, coefficient in parts.items():
                if j % 2 == parity:
                    total += coefficient * a ** ((highest - j + 1) // 2)
            if not self._vanishes(total, roots - 1):
                return False
        return True

    def _by_power(self, p, s: int) -> dict[int, Any]:
        parts: dict[int, dict] = {}
        for monomial, coefficient in p.to_dict().items():
            rest = tuple(0 if i == s else e for i, e in enumerate(monomial))
            parts.setdefault(int(monomial[s]), {})[rest] = coefficient
        return {j: self.context.from_dict(terms) for j, terms in parts.items()}

    def _without_square(self, p, s: int, square):
        """The polynomial with even powers of a generator replaced."""
        total = self.constant(0)
        for j, coefficient in self._by_power(p, s).items():
            total += coefficient * square ** (j // 2) * self.generators[s] ** (j % 2)
        return total

    def _at(self, a: Number | None, found: dict):
        if not isinstance(a, Node):
            return a if isinstance(a, bool) else self.constant(a)
        if isinstance(found[a], NoPolynomial):
            raise found[a]
        return found[a]

    def _value(self, node: Node, found: dict):
        op, args = node.op, node.args
        if node in self.apart:
            return op == "ne"
        if op in LOGIC:
            return self._combine(node, found)
        if op == "select":
            return self._at(args[2] if self._at(args[0], found) else args[1], found)
        value = self._polynomial(node, found)
        if len(value) > _MOST_TERMS:
            raise NoPolynomial("a polynomial of too many terms")
        return value

    def _combine(self, node: Node, found: dict) -> bool:
        """The value of a logical operation, which one operand alone may decide."""
        decisive = node.op == "or"
        if node.op != "not" and any(found.get(a, a) is decisive for a in node.args):
            return decisive
        return LOGIC[node.op](*(self._at(a, found) for a in node.args))

    def _polynomial(self, node: Node, found: dict):
        op, args = node.op, node.args
        if op == "sum":
            total = self.constant(0)
            for factor, term in zip(args[::2], args[1::2], strict=True):
                part = self._at(factor, found)
                total += part if term is None else part * self._at(term, found)
            return total
        if op == "pow" and not isinstance(args[1], Node):
            return self._power(self._at(args[0], found), args[1])
        operands = [self._at(a, found) for a in args]
        if op == "add":
            return operands[0] + operands[1]
        if op in ("mul", "scale", "product"):
            return operands[0] * operands[1]
        if op == "div":
            return operands[0] * self._power(operands[1], -1.0)
        if op == "sqrt":
            return self._power(operands[0], 0.5)
        if op in ("sin", "cos"):
            return self._circular(op, operands[0])
        if op == "exp" and operands[0] and operands[0].leading_coefficient() < 0:
            return self._power(self._function((op, str(-operands[0]))), -1.0)
        if op in ("exp", "log", "tanh", "atan"):
            return self._function((op, str(operands[0])))
        raise NoPolynomial(op)

    def _power(self, a, n: float):
        twice = 2 * n
        if not float(twice).is_integer():
            return self._function((n, str(a)))
        twice = int(twice)
        if twice >= 0 and twice % 2 == 0:
            return a ** (twice // 2)
        if a.is_zero():
            raise NoPolynomial("a division by 0")
        if a.is_constant() and twice % 2 == 0:
            return self.constant(0) + (1 / a.leading_coefficient()) ** (-twice // 2)
        known = self._as_power(a)
        if known is not None and twice % 2 == 0:
            s, m = known
            if m * twice // 2 >= 0:
                return self.generators[s] ** (m * twice // 2)
        s = self.generators[self._root(a)]
        return s**-twice if twice < 0 else a ** ((twice + 1) // 2) * s

    def _as_power(self, p) -> tuple[int, int] | None:
        """(s, m) where p = s^m for a known generator s, as for r^2 sqrt(r^2); else None."""
        for a, s in self._roots:
            for half in range(1, _MOST_HALVES):
                power = a ** ((half + 1) // 2) * self.generators[s] ** (half % 2)
                if p == power:
                    return s, -half
        return None

    def _root(self, a) -> int:
        """The index of s with s^2 a = 1."""
        for base, s in self._roots:
            if base == a:
                return s
        s = self._new()
        self._roots.append((a, s))
        return s

    def _circular(self, op: str, a):
        if a.is_zero():
            return self.constant(int(op == "cos"))
        sign = 1 if a.leading_coefficient() > 0 else -1
        key = ("circle", str(a * sign))
        if key not in self._functions:
            s, c = self._new(), self._new()
            self._sines.append((s, c))
            self._functions[key] = s, c
        s, c = self._functions[key]
        return self.generators[c] if op == "cos" else sign * self.generators[s]

    def _function(self, key: tuple):
        if key not in self._functions:
            self._functions[key] = self.generators[self._new()]
        return self._functions[key]

    def _new(self) -> int:
        if self._used == len(self.generators):
            raise NoPolynomial("too many functions")
        self._used += 1
        return self._used - 1
