"""Sums of products of powers: the form of expressions in printed equations.

An `Expression` is a sum of terms, each a rational coefficient and powers of atoms: a `Symbol`, a
`Call` of a function, or a `Group`, a sum in brackets. Products of sums are multiplied out, so that
equal terms cancel, except for differences such as x - a or x2 - x1: these stay in brackets, as a
reader expects.

Exponents are rational: a root is the power 1/2, a quotient the power -1. Points at which an
expression is not defined, such as r = 0 in x / r, are ignored, as on paper.
"""

import functools
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Any

from jaxdyn import _checks

#: A rational number; a float if it does not stand for one with a small denominator.
Coefficient = Fraction | float
#: Atoms and their exponents, sorted.
Monomial = tuple[tuple["Atom", Fraction], ...]

#: Largest denominator of the rational number that a float is taken to be.
_LARGEST_DENOMINATOR = 10_000
#: The same for multiples of pi.
_OF_PI = 100
#: Largest relative difference of a float from that rational number: two roundings.
_ROUNDED = 2.0**-51
#: Largest number of terms of an expression; six hinged bars have some hundred.
_MOST_TERMS = 500
#: Largest power that is multiplied out.
_LARGEST_EXPANDED = 4

ONE = Fraction(1)


class Symbol:
    """A quantity with a name.

    Attributes:
      name: unique name that identifies it.
      kind: "parameter", "time", "coordinate", "velocity", "acceleration", "rate" (the derivative of
        an entry without a second derivative), "multiplier" or "short" (an abbreviation).
      rank: its position among the symbols of its kind.
      stem: stem of its printed name, such as "theta".
      index: its subscript, such as "1" or "12".
      dots: number of time derivatives.
      positive: whether it is known to be positive.
    """

    __slots__ = ("dots", "index", "key", "kind", "name", "positive", "rank", "stem")

    def __init__(
        self,
        name: str,
        kind: str,
        *,
        stem: str = "",
        index: str = "",
        rank: float = 0,
        dots: int = 0,
        positive: bool = False,
    ):
        self.name, self.kind, self.rank, self.dots = name, kind, rank, dots
        self.stem, self.index, self.positive = stem or name, index, positive
        self.key = (0, KINDS.index(kind), rank, name)

    def __hash__(self) -> int:
        return hash(self.name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Symbol) and self.name == other.name

    def __repr__(self) -> str:
        return self.name


#: Kinds of symbols, in the order in which a product has them.
KINDS = (
    *("time", "parameter", "multiplier", "short", "coordinate"),
    *("velocity", "rate", "acceleration"),
)


class Call:
    """A function of expressions: "sin", "abs", "select" of a condition and two values."""

    __slots__ = ("_hash", "args", "key", "op")

    def __init__(self, op: str, *args: "Expression"):
        self.op, self.args = op, args
        self._hash = hash((op, args))
        self.key = (2, 0, 0, f"{op}({', '.join(map(repr, args))})")

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Call) and self.op == other.op and self.args == other.args

    def __repr__(self) -> str:
        return self.key[-1]


class Group:
    """A sum in brackets whose first term is positive."""

    __slots__ = ("key", "sum")

    def __init__(self, inner: "Expression"):
        self.sum = inner
        self.key = (1, 0, 0, f"({inner!r})")

    def __hash__(self) -> int:
        return hash(self.sum)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Group) and self.sum == other.sum

    def __repr__(self) -> str:
        return self.key[-1]


Atom = Symbol | Call | Group


class Expression:
    """A sum of terms: coefficients by monomial, none of them 0."""

    __slots__ = ("_hash", "_text", "terms")

    def __init__(self, terms: Mapping[Monomial, Coefficient]):
        self.terms = {m: c for m, c in terms.items() if c != 0}
        if len(self.terms) > _MOST_TERMS:
            raise _checks.fail(
                "equations",
                "a scene whose equations fill some pages",
                f"more than {_MOST_TERMS} terms in one of them",
                'Take another formulation, such as "constrained"; jaxdyn.symbolic.code(scene, '
                '"python") has its rate step by step.',
            )
        self._hash: int | None = None
        self._text: str | None = None

    def __hash__(self) -> int:
        if self._hash is None:
            self._hash = hash(frozenset(self.terms.items()))
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Expression) and self.terms == other.terms

    def __repr__(self) -> str:
        if self._text is None:
            parts = (f"{c}*{list(m)!r}" for m, c in sorted(self.terms.items(), key=_place))
            self._text = " + ".join(parts) or "0"
        return self._text

    def __bool__(self) -> bool:
        return bool(self.terms)

    def __add__(self, other: "Expression | Coefficient | int") -> "Expression":
        terms = dict(self.terms)
        for m, c in as_expression(other).terms.items():
            terms[m] = terms.get(m, 0) + c
        return Expression(terms)

    def __neg__(self) -> "Expression":
        return Expression({m: -c for m, c in self.terms.items()})

    def __sub__(self, other: "Expression | Coefficient | int") -> "Expression":
        return self + (-as_expression(other))

    def __mul__(self, other: "Expression | Atom | Coefficient | int") -> "Expression":
        other = as_expression(other)
        if self.is_number or other.is_number:
            number, rest = (self, other) if self.is_number else (other, self)
            return Expression({m: c * number.number for m, c in rest.terms.items()})
        a, b = (x.in_brackets() if x.is_difference else x for x in (self, other))
        found: dict[Monomial, Coefficient] = {}
        for m, c in a.terms.items():
            for n, d in b.terms.items():
                for product, e in _product(m, n).terms.items():
                    found[product] = found.get(product, 0) + c * d * e
        return Expression(found)

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, other: "Coefficient | int") -> "Expression":
        return as_expression(other) - self

    def __truediv__(self, other: "Expression | Coefficient | int") -> "Expression":
        return self * as_expression(other) ** -1

    def __rtruediv__(self, other: "Coefficient | int") -> "Expression":
        return as_expression(other) / self

    def __pow__(self, n: Fraction | int) -> "Expression":
        n = Fraction(n)
        if n == 1:
            return self
        if n == 0:
            return number(1)
        if len(self.terms) == 1:
            return self._term_to(n)
        if n.denominator == 1 and 0 < n <= _LARGEST_EXPANDED and not self.is_difference:
            return functools.reduce(Expression.__mul__, [self] * int(n))
        if not self.terms:
            return number(0) if n > 0 else number(math.inf)
        content = content_of(self.terms.values())
        inner = self / content
        if n.denominator == 1:
            sign = -1 if inner.leading < 0 else 1
            return number(content) ** n * _atom(Group(inner * sign), n) * sign ** int(n)
        root = _exact_power(content, n)
        if root is None:
            return _atom(Group(self), n)
        return number(root) * _atom(Group(inner), n)

    def _term_to(self, n: Fraction) -> "Expression":
        """A power of a single term."""
        ((monomial, c),) = self.terms.items()
        if n.denominator == 1:
            scale = c ** int(n) if c else c
            if 0 < n <= _LARGEST_EXPANDED and any(isinstance(a, Call) for a, _ in monomial):
                return functools.reduce(Expression.__mul__, [self] * int(n))
            return Expression({tuple((a, e * n) for a, e in monomial): scale})
        found, left = number(1), Expression({(): c})
        root = _exact_power(c, n) if c > 0 else None
        if root is not None:
            found, left = number(root), number(1)
        for a, e in monomial:
            if isinstance(a, Symbol) and a.positive:
                found = found * _atom(a, e * n)
            elif e.denominator == 1 and e % 2 == 0:
                size = _atom(a, ONE) if (e * n) % 2 == 0 else function("abs", _atom(a, ONE))
                found = found * size ** (e * n)
            else:
                left = left * _atom(a, e)
        if left == number(1):
            return found
        ((monomial, c),) = left.terms.items()
        if c == 1 and len(monomial) == 1:
            ((a, e),) = monomial
            return found * _atom(a, e * n)
        return found * _atom(Group(left), n)

    @property
    def is_number(self) -> bool:
        """Whether it contains no atoms."""
        return not self.terms or set(self.terms) == {()}

    @property
    def number(self) -> Coefficient:
        """The value of an expression without atoms."""
        return self.terms.get((), Fraction(0))

    @property
    def is_difference(self) -> bool:
        """Whether it stays in brackets: symbols with coefficients equal up to sign."""
        if len(self.terms) < 2:
            return False
        plain = [(m, c) for m, c in self.terms.items() if m]
        sizes = {abs(c) for _, c in plain}
        single = all(len(m) == 1 and m[0][1] == 1 for m, _ in plain)
        return single and len(sizes) == 1 and any(_is_of_state(m[0][0]) for m, _ in plain)

    @property
    def leading(self) -> Coefficient:
        """The coefficient of the first term; in a difference, of its first symbol of the state."""
        if self.is_difference:
            state = {m: c for m, c in self.terms.items() if m and _is_of_state(m[0][0])}
            return min(state.items(), key=_place)[1]
        return min(self.terms.items(), key=_place)[1]

    def in_brackets(self) -> "Expression":
        """A difference as a number times a `Group`."""
        c = self.leading
        return Expression({((Group(self / c), ONE),): c})

    def symbols(self) -> set[Symbol]:
        """All symbols in it."""
        return {s for m in self.terms for a, _ in m for s in symbols_of(a)}

    def replace(self, what: Callable[[Atom], "Expression | None"]) -> "Expression":
        """The expression with atoms replaced where `what` returns one, also inside other atoms."""
        found = number(0)
        for m, c in self.terms.items():
            term = number(c)
            for a, e in m:
                term = term * _replace(a, what) ** e
            found = found + term
        return found

    def differentiate(self, by: Symbol) -> "Expression":
        """The derivative with respect to a symbol."""
        found = number(0)
        for m, c in self.terms.items():
            for i, (a, e) in enumerate(m):
                inner = _derivative(a, by)
                if inner:
                    rest = Expression({(*m[:i], *m[i + 1 :]): c * e})
                    found = found + rest * _atom(a, ONE) ** (e - 1) * inner
        return found

    def expand(self) -> "Expression":
        """The expression with all brackets with positive integer powers multiplied out."""
        found: dict[Monomial, Coefficient] = {}
        for m, c in self.terms.items():
            term = {(): c}
            for a, e in m:
                factors = [{((a, e),): ONE}]
                if isinstance(a, Group) and e.denominator == 1 and e > 0:
                    factors = [a.sum.expand().terms] * int(e)
                for factor in factors:
                    term = _multiply(term, factor)
            for n, d in term.items():
                found[n] = found.get(n, 0) + d
        return Expression(found)

    def over_one_line(self) -> "Expression":
        """The expression over common denominators that are sums, cancelled where possible."""
        found = self
        denominators = {a for m in found.terms for a, e in m if _is_denominator(a, e)}
        for denominator in sorted(denominators, key=lambda a: a.key):
            most = max(
                (-e for m in found.terms for a, e in m if a == denominator and e < 0), default=0
            )
            whole = _multiply(found.terms, {((denominator, Fraction(most)),): ONE})
            numerator = Expression(whole).expand()
            while most and (quotient := _divide(numerator, denominator.sum.expand())) is not None:
                numerator, most = quotient, most - 1
            found = Expression(
                _multiply(numerator.terms, {((denominator, -most),) if most else (): ONE})
            )
        return found

    def value(self, values: Mapping[Symbol, Any]) -> Any:
        """Its value for numbers, or arrays of them, in place of the symbols."""
        found = 0.0
        for m, c in self.terms.items():
            term = float(c)
            for a, e in m:
                term = term * _power(_value(a, values), e)
            found = found + term
        return found


_OF_STATE = frozenset({"coordinate", "velocity", "rate", "acceleration", "short"})


#: The number pi, kept as a symbol.
PI = Symbol("pi", "parameter", rank=-1, positive=True)


def as_expression(x: "Expression | Atom | Coefficient | int") -> Expression:
    """An atom, or a number, as an expression."""
    if isinstance(x, Expression):
        return x
    return _atom(x, ONE) if isinstance(x, Symbol | Call | Group) else number(x)


def number(x: Coefficient | int) -> Expression:
    """A number as an expression: the rational one that a float stands for, if that is simple."""
    found = rational(x)
    if isinstance(found, float):
        for power in (1, 2, -1):
            of_pi = rational(found / math.pi**power)
            if isinstance(of_pi, Fraction) and of_pi.denominator <= _OF_PI:
                return Expression({((PI, Fraction(power)),): of_pi})
    return Expression({(): found} if found else {})


def rational(x: Coefficient | int) -> Coefficient:
    """The rational number with a small denominator that rounds to a float, or the float."""
    if isinstance(x, Fraction | int):
        return Fraction(x)
    if not math.isfinite(x):
        return x
    near = Fraction(x).limit_denominator(_LARGEST_DENOMINATOR)
    return near if abs(float(near) - x) <= _ROUNDED * abs(x) else float(x)


def content_of(numbers: Collection[Coefficient]) -> Coefficient:
    """The largest positive rational number that divides all numbers into integers; else 1."""
    found = [c for c in numbers if isinstance(c, Fraction)]
    if len(found) < len(numbers):
        return ONE
    whole = math.gcd(*(c.numerator for c in found))
    return Fraction(whole, math.lcm(*(c.denominator for c in found)))


def function(op: str, *args: Expression) -> Expression:
    """A call of a function, simplified where its value is known."""
    (a, *others) = args
    if op in ("sin", "cos", "tan", "sinh", "tanh", "atan", "asin") and not others:
        if not a:
            return number(1 if op == "cos" else 0)
        if a.leading < 0:
            return function(op, -a) if op == "cos" else -function(op, -a)
    if op in ("sin", "cos") and (turns := _quarters(a)) is not None:
        return number((0, 1, 0, -1)[(turns + (op == "cos")) % 4])
    if op in _FUNCTIONS and not others and a.is_number and isinstance(a.number, float):
        return number(_FUNCTIONS[op](a.number))
    if op in ("exp", "cosh") and not a:
        return number(1)
    if op == "abs" and not others:
        if a.is_number:
            return number(abs(a.number))
        a = a * (-1 if a.leading < 0 else 1)
        return _absolute(a)
    if op == "sign" and not others and not a.is_number and a.leading < 0:
        return -function(op, -a)
    if op == "select" and others[0] == others[1]:
        return others[0]
    return _atom(Call(op, *args), ONE)


def _quarters(a: Expression) -> int | None:
    """The number of quarter turns in an angle, if it is an integer."""
    halves = a.terms.get(((PI, ONE),), None) if len(a.terms) == 1 else None
    if isinstance(halves, Fraction) and (2 * halves).denominator == 1:
        return int(2 * halves)
    return None


def _absolute(a: Expression) -> Expression:
    """The absolute value of an expression whose first term is positive."""
    if len(a.terms) > 1:
        return _atom(Call("abs", a), ONE)
    ((monomial, c),) = a.terms.items()
    found = number(abs(c))
    for atom, e in monomial:
        known = isinstance(atom, Symbol) and atom.positive
        even = e.denominator == 1 and e % 2 == 0
        whole = atom if known or even else Call("abs", _atom(atom, ONE))
        found = found * _atom(whole, e)
    return found


def symbols_of(a: Atom) -> set[Symbol]:
    """All symbols in an atom."""
    if isinstance(a, Symbol):
        return {a}
    return {s for x in sums_in(a) for s in x.symbols()}


def sums_in(a: Atom) -> tuple[Expression, ...]:
    """The sum in a bracket, the arguments of a function."""
    if isinstance(a, Group):
        return (a.sum,)
    return a.args if isinstance(a, Call) else ()


def factors_in(x: Expression) -> Iterator[tuple[Atom, Fraction]]:
    """All factors of a sum, each followed by those inside it."""
    for m in x.terms:
        for a, e in m:
            yield a, e
            for inner in sums_in(a):
                yield from factors_in(inner)


def _atom(a: Atom, e: Fraction) -> Expression:
    if isinstance(a, Call) and a.op == "abs" and e.denominator == 1 and e % 2 == 0:
        return a.args[0] ** e
    return Expression({((a, Fraction(e)),): ONE})


def _product(m: Monomial, n: Monomial) -> Expression:
    """The product of two monomials."""
    if not m or not n:
        return Expression({m or n: ONE})
    powers = dict(m)
    for a, e in n:
        powers[a] = powers.get(a, Fraction(0)) + e
    factor = number(1)
    for a in [a for a in powers if isinstance(a, Call) and a.op == "abs"]:
        e = powers[a]
        inner = a.args[0]
        if e.denominator == 1 and e % 2 == 0 and e:
            del powers[a]
            factor = factor * inner**e
        elif e == -1 and len(inner.terms) == 1:
            # x / |x| is the sign of x.
            ((base, c),) = inner.terms.items()
            if c == 1 and len(base) == 1 and base[0][1] == 1 and powers.get(base[0][0], 0) == 1:
                del powers[a], powers[base[0][0]]
                factor = factor * function("sign", inner)
    for a in [a for a in powers if isinstance(a, Call) and a.op == "pow" and powers[a] == 1]:
        base, exponent = a.args
        (m, *several) = base.terms or [()]
        if not several and len(m) == 1 and base.terms[m] == 1 and m[0][0] in powers:
            del powers[a]
            more = powers.pop(m[0][0]) / m[0][1]
            factor = factor * function("pow", base, exponent + more)
    for a in [a for a in powers if isinstance(a, Call) and a.op == "sign"]:
        powers[a] = powers[a] % 2
    plain = in_order(powers)
    brackets = [
        (a, e)
        for a, e in plain
        if isinstance(a, Group) and e.denominator == 1 and e > 0 and not a.sum.is_difference
    ]
    if brackets:  # for example when a root is squared
        plain = tuple(x for x in plain if x not in brackets)
        for a, e in brackets:
            factor = factor * a.sum**e
    return Expression({plain: ONE}) if factor == number(1) else factor * Expression({plain: ONE})


def _is_denominator(a: Atom, e: Fraction) -> bool:
    return isinstance(a, Group) and e.denominator == 1 and e < 0


def _divide(above: Expression, below: Expression) -> Expression | None:
    """The quotient of two sums of integer powers, if it has no remainder."""
    lead = _highest(below)
    found, left = number(0), above
    while left:
        top = _highest(left)
        m = times(top, inverse(lead))
        if any(e < 0 for _, e in m):
            return None
        part = {m: left.terms[top] / below.terms[lead]}
        found = found + Expression(part)
        left = left - Expression(_multiply(part, below.terms))
    return found


def _highest(x: Expression) -> Monomial:
    """The leading monomial in a monomial order, by powers of one atom after another."""
    atoms = sorted({a for m in x.terms for a, _ in m}, key=lambda a: a.key)
    return max(x.terms, key=lambda m: [dict(m).get(a, Fraction(0)) for a in atoms])


def _multiply(
    a: Mapping[Monomial, Coefficient], b: Mapping[Monomial, Coefficient]
) -> dict[Monomial, Coefficient]:
    """A product without any brackets."""
    found: dict[Monomial, Coefficient] = {}
    for m, c in a.items():
        for n, d in b.items():
            key = times(m, n)
            found[key] = found.get(key, 0) + c * d
    return found


def _place(term: tuple[Monomial, Coefficient]) -> tuple:
    """Sort key of a term: the first term of a sum has to be the same in every process."""
    return tuple((a.key, -e) for a, e in term[0])


def _is_of_state(a: Atom) -> bool:
    return isinstance(a, Symbol) and a.kind in _OF_STATE


def _replace(a: Atom, what: Callable[[Atom], Expression | None]) -> Expression:
    found = what(a)
    if found is not None:
        return found
    if isinstance(a, Group):
        return a.sum.replace(what)
    if isinstance(a, Call):
        return function(a.op, *(x.replace(what) for x in a.args))
    return _atom(a, ONE)


def _exact_power(c: Coefficient, n: Fraction) -> Fraction | None:
    """A power of a positive number, if it is rational."""
    if not isinstance(c, Fraction):
        return None
    above, below = (_root(x, n.denominator) for x in (c.numerator, c.denominator))
    if above is None or below is None:
        return None
    return Fraction(above, below) ** n.numerator


def _root(x: int, n: int) -> int | None:
    found = round(x ** (1 / n))
    return found if found**n == x else None


def _derivative(a: Atom, by: Symbol) -> Expression:
    """The derivative of an atom."""
    if isinstance(a, Symbol):
        return number(1 if a == by else 0)
    if by not in symbols_of(a):
        return number(0)
    if isinstance(a, Group):
        return a.sum.differentiate(by)
    if a.op == "select":
        which, yes, no = a.args
        return function("select", which, yes.differentiate(by), no.differentiate(by))
    if a.op == "pow":
        base, exponent = a.args
        slope = exponent.differentiate(by) * function("log", base)
        return as_expression(a) * (slope + exponent * base.differentiate(by) / base)
    if a.op in _STEPS:
        return number(0)
    if a.op not in _SLOPES:
        raise _checks.fail(
            "equations",
            "functions whose derivative is known",
            a.op,
            "jaxdyn.symbolic.code(scene, 'python') can write this rate.",
        )
    (x,) = a.args
    return _SLOPES[a.op](x) * x.differentiate(by)


_STEPS = frozenset({"sign", "floor", "ceil", "step"})
_SLOPES: dict[str, Callable[[Expression], Expression]] = {
    "sin": lambda x: function("cos", x),
    "cos": lambda x: -function("sin", x),
    "tan": lambda x: function("cos", x) ** -2,
    "exp": lambda x: function("exp", x),
    "log": lambda x: x**-1,
    "sinh": lambda x: function("cosh", x),
    "cosh": lambda x: function("sinh", x),
    "tanh": lambda x: function("cosh", x) ** -2,
    "asin": lambda x: (1 - x * x) ** Fraction(-1, 2),
    "acos": lambda x: -((1 - x * x) ** Fraction(-1, 2)),
    "atan": lambda x: (1 + x * x) ** -1,
    "abs": lambda x: function("sign", x),
}


def _value(a: Atom, values: Mapping[Symbol, Any]) -> Any:
    if isinstance(a, Symbol):
        return math.pi if a is PI else values[a]
    if isinstance(a, Group):
        return a.sum.value(values)
    args = [x.value(values) for x in a.args]
    if a.op == "select":
        return args[1] if args[0] else args[2]
    return _FUNCTIONS[a.op](*args)


def _power(x: float, e: Fraction) -> float:
    if e.denominator == 1:
        return x ** int(e)
    if e.denominator == 2:
        return math.sqrt(x) ** e.numerator
    return math.pow(x, e)


_FUNCTIONS: dict[str, Callable] = {
    **{name: getattr(math, name) for name in ("sin", "cos", "tan", "exp", "log", "floor", "ceil")},
    **{name: getattr(math, name) for name in ("sinh", "cosh", "tanh", "asin", "acos", "atan")},
    **{name: getattr(math, name) for name in ("asinh", "acosh", "atanh", "atan2", "cbrt", "exp2")},
    **{name: getattr(math, name) for name in ("expm1", "log1p", "erf", "pow")},
    "abs": abs,
    "sign": lambda x: float((x > 0) - (x < 0)),
    "step": lambda x: float(x >= 0),
    "max": max,
    "min": min,
    "rem": math.fmod,
    "logistic": lambda x: 1 / (1 + math.exp(-x)),
    "is_finite": math.isfinite,
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "gt": lambda a, b: a > b,
    "ge": lambda a, b: a >= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "not": lambda a: not a,
}


def in_order(powers: Mapping[Atom, Fraction]) -> Monomial:
    """The monomial with these powers, sorted."""
    return tuple(sorted(((a, e) for a, e in powers.items() if e), key=lambda x: x[0].key))


def times(m: Monomial, n: Monomial) -> Monomial:
    """The product of two monomials without multiplying out brackets."""
    powers = dict(m)
    for a, e in n:
        powers[a] = powers.get(a, Fraction(0)) + e
    return in_order(powers)


def inverse(m: Monomial) -> Monomial:
    """One over a monomial."""
    return tuple((a, -e) for a, e in m)


def total(parts: Iterable[Expression]) -> Expression:
    """A sum."""
    return sum(parts, number(0))
