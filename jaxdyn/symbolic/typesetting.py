"""Expressions in print: as plain text, in LaTeX, and in MathML.

The order of factors and terms is decided here, for all three formats: in a product numbers,
parameters, brackets, coordinates, velocities, functions; in a sum the terms with the highest
derivatives first.
"""

import abc
import html
from collections.abc import Sequence
from fractions import Fraction

from jaxdyn.symbolic.algebra import (
    Atom,
    Call,
    Coefficient,
    Expression,
    Group,
    Monomial,
    Symbol,
    symbols_of,
)
from jaxdyn.symbolic.symbols import GREEK, split_name

_PLACES = {
    **{"parameter": 0, "multiplier": 1, "time": 3, "coordinate": 3, "short": 3},
    **{"velocity": 5, "rate": 6, "acceleration": 6},
}
#: Functions come last: x'' cos(theta).
_BRACKET, _MOVING_BRACKET, _FUNCTION = 2, 4, 7
_SIGNS = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "=", "ne": "!="}


class Style(abc.ABC):
    """How the parts of an expression are written; each method returns the text."""

    @abc.abstractmethod
    def symbol(self, s: Symbol) -> str: ...

    @abc.abstractmethod
    def number(self, x: Coefficient) -> str:
        """A positive integer, or a float."""

    @abc.abstractmethod
    def fraction(self, above: str, below: str, single: bool, last: bool) -> str:
        """A quotient; `single` if the denominator is one factor, `last` if nothing follows."""

    @abc.abstractmethod
    def power(self, base: str, exponent: str) -> str: ...

    @abc.abstractmethod
    def root(self, x: str) -> str: ...

    @abc.abstractmethod
    def brackets(self, x: str) -> str: ...

    @abc.abstractmethod
    def call(self, op: str, args: Sequence[str], exponent: str, plain: bool) -> str:
        """A function; `plain` if its argument is a single symbol."""

    @abc.abstractmethod
    def choice(self, condition: str, yes: str, no: str) -> str: ...

    @abc.abstractmethod
    def product(self, factors: Sequence[str]) -> str: ...

    @abc.abstractmethod
    def sum(self, terms: Sequence[tuple[bool, str]]) -> str:
        """Terms, each with whether it is subtracted."""

    @abc.abstractmethod
    def relation(self, left: str, sign: str, right: str) -> str: ...

    @abc.abstractmethod
    def matrix(self, rows: Sequence[Sequence[str]]) -> str: ...

    def expression(self, x: Expression) -> str:
        """A sum of terms in a readable order."""
        terms = [_turn(m, c) for m, c in x.terms.items()]
        terms.sort(key=lambda term: _term_place(term[0]))
        if _ascends(terms):
            terms.sort(key=lambda term: _moves(term[0]))
        elif all(s.kind == "parameter" for s in x.symbols()):
            terms.sort(key=lambda term: len(term[0]))  # I + m d^2
        if len(terms) > 1 and terms[0][1] < 0:
            first = next((i for i, (_, c) in enumerate(terms) if c > 0), 0)
            if _degree(terms[first][0]) == _degree(terms[0][0]):
                terms.insert(0, terms.pop(first))
        return self.sum([(c < 0, self._term(m, abs(c), c > 0)) for m, c in terms])

    #: Whether fraction bars group numerator and denominator.
    bars = True

    def _term(self, m: Monomial, c: Coefficient, added: bool) -> str:
        factors = sorted(m, key=_factor_place)
        above = [(a, e) for a, e in factors if e > 0]
        below = [(a, -e) for a, e in factors if e < 0]
        numerator, denominator = (c.numerator, c.denominator) if isinstance(c, Fraction) else (c, 1)
        if not below:
            return self._without_quotient(above, numerator, denominator, added)
        steady = [f for f in above if _factor_place(f)[0] == 0]
        behind: list[tuple[Atom, Fraction]] = []
        if steady and all(_factor_place(f)[0] == 0 for f in below):
            above, behind = steady, [f for f in above if f not in steady]
        top = [
            self._factor(a, e, self.bars and len(above) == 1 and numerator == 1) for a, e in above
        ]
        top = [self.number(numerator)] * (numerator != 1 or not top) + top
        low = [
            self._factor(a, e, self.bars and len(below) == 1 and denominator == 1) for a, e in below
        ]
        low = [self.number(denominator)] * (denominator != 1) + low
        quotient = self.fraction(self.product(top), self.product(low), len(low) == 1, not behind)
        return self.product([quotient, *(self._factor(a, e, False) for a, e in behind)])

    def _without_quotient(
        self, above: list, numerator: Coefficient, denominator: int, added: bool
    ) -> str:
        alone = added and len(above) == 1 and numerator == denominator == 1
        parts = [self._factor(a, e, alone) for a, e in above]
        if denominator != 1:
            ratio = self.fraction(self.number(numerator), self.number(denominator), True, True)
            return self.product([ratio, *parts])
        return self.product([self.number(numerator)] * (numerator != 1 or not parts) + parts)

    def _factor(self, a: Atom, e: Fraction, alone: bool) -> str:
        """A factor; a bracket that is `alone` needs no brackets."""
        if isinstance(a, Call):
            return self._call(a, e)
        if e.denominator == 2:
            inner = self.expression(a.sum) if isinstance(a, Group) else self.symbol(a)
            if e == Fraction(1, 2):
                return self.root(inner)
            base = self.brackets(inner) if isinstance(a, Group) else inner
            return self.power(base, f"{e.numerator}/2")
        if isinstance(a, Group):
            inner = self.expression(a.sum)
            base = inner if alone and e == 1 else self.brackets(inner)
        else:
            base = self.symbol(a)
        return base if e == 1 else self.power(base, str(e))

    def _call(self, a: Call, e: Fraction) -> str:
        if a.op == "select":
            which, yes, no = a.args
            found = self.choice(*(self.expression(x) for x in (which, yes, no)))
            return found if e == 1 else self.power(found, str(e))
        if a.op in _SIGNS:
            left, right = (self.expression(x) for x in a.args)
            return self.relation(left, _SIGNS[a.op], right)
        args = [self.expression(x) for x in a.args]
        if a.op == "pow":
            plain = _is_symbol(a.args[0]) or a.args[0].terms.keys() <= _absolute_values(a.args[0])
            base = args[0] if plain else self.brackets(args[0])
            return self.power(base, args[1])
        plain = a.op in _PLAIN and _is_symbol(a.args[0])
        return self.call(a.op, args, "" if e == 1 else str(e), plain)


def _is_symbol(x: Expression) -> bool:
    (m, *others) = x.terms or [()]
    return (
        not others
        and len(m) == 1
        and isinstance(m[0][0], Symbol)
        and m[0][1] == 1
        and x.terms[m] == 1
    )


def _absolute_values(x: Expression) -> set[Monomial]:
    """The terms of an expression that are absolute values, which need no further brackets."""
    return {m for m in x.terms if len(m) == 1 and isinstance(m[0][0], Call) and m[0][0].op == "abs"}


def _turn(m: Monomial, c: Coefficient) -> tuple[Monomial, Coefficient]:
    """A term with -(x1 - x2) as x2 - x1."""
    if c > 0:
        return m, c
    moving = any(isinstance(a, Symbol) and a.kind == "coordinate" for a, _ in m)
    for i, (a, e) in enumerate(m):
        if isinstance(a, Group) and e.denominator == 1 and e % 2 and a.sum.is_difference:
            kinds = {s.kind for s in a.sum.symbols()}
            signs = {x > 0 for x in a.sum.terms.values()}
            if len(signs) == 2 and (len(kinds) == 1 or (moving and "coordinate" in kinds)):
                return (*m[:i], (Group(-a.sum), e), *m[i + 1 :]), -c
    return m, c


def _factor_place(factor: tuple[Atom, Fraction]) -> tuple:
    """Sort key of a factor in a product."""
    a, _ = factor
    if isinstance(a, Symbol):
        return _PLACES[a.kind], a.rank, a.name
    moves = any(s.kind not in ("parameter", "short") for s in symbols_of(a))
    if isinstance(a, Group):
        inside = a.sum.symbols()
        if moves or any(s.kind == "short" for s in inside):
            return (_MOVING_BRACKET if moves else _BRACKET), 0, repr(a)
        # (m1 + m2) g l: before lengths, in the position of a mass.
        return 0, min((s.rank for s in inside), default=0), ""
    return _FUNCTION, 0, repr(a)


def _degree(m: Monomial) -> tuple:
    """The derivatives in a term, the highest first."""
    kinds = {kind: Fraction(0) for kind in ("acceleration", "rate", "multiplier", "velocity")}
    for a, e in m:
        for s in symbols_of(a) if isinstance(a, Group) else [a]:
            if isinstance(s, Symbol) and s.kind in kinds:
                kinds[s.kind] += abs(e)
    second = kinds["acceleration"] + kinds["rate"]
    return -second, kinds["multiplier"], -kinds["velocity"]


def _term_place(m: Monomial) -> tuple:
    """Sort key of a term in a sum: by derivatives, by moving factors, by parameters."""
    factors = sorted(m, key=_factor_place)
    kinds = {s.kind for a, _ in m for s in symbols_of(a)}
    linear = any(isinstance(a, Symbol) and a.kind == "time" for a, _ in m)
    steady = 0 if not m or linear or kinds & _MOVING else 2 if "time" in kinds else 1
    plain = [f for f in factors if not isinstance(f[0], Group)]
    plain.sort(key=lambda f: _factor_place(f)[0] == _FUNCTION, reverse=True)
    moving = [(_late(f), -f[1]) for f in reversed(plain) if _factor_place(f)[0] > _BRACKET]
    multipliers = sorted(a.rank for a, _ in m if isinstance(a, Symbol) and a.kind == "multiplier")
    return *_degree(m), steady, multipliers, moving, [(_factor_place(f), -f[1]) for f in factors]


def _late(factor: tuple[Atom, Fraction]) -> tuple:
    """The place of a factor in sorting terms; lengths in denominators come after coordinates."""
    place, *rest = _factor_place(factor)
    a, e = factor
    return (place + (isinstance(a, Symbol) and a.kind == "short" and e < 0) / 2, *rest)


def _moves(m: Monomial) -> bool:
    return any(s.kind in _MOVING for a, _ in m for s in symbols_of(a))


def _ascends(terms: Sequence[tuple[Monomial, Coefficient]]) -> bool:
    """Whether a sum consists of parameters and squares of coordinates, as I + m (d^2 + s^2)."""
    moving = [m for m, _ in terms if _moves(m)]
    return 0 < len(moving) < len(terms) and all(map(_is_even, moving))


def _is_even(m: Monomial) -> bool:
    """Whether a term is a square, or a sum of squares in brackets, with a constant factor."""
    for a, e in m:
        inner = a.sum.terms if isinstance(a, Group) else ()
        squares = e == 1 and bool(inner) and all(_is_even(n) for n in inner)
        place = isinstance(a, Symbol) and a.kind == "coordinate" and e % 2 == 0
        if _moves(((a, e),)) and not (squares or place):
            return False
    return True


_MOVING = frozenset({"coordinate", "velocity", "rate", "acceleration", "multiplier", "short"})


class Text(Style):
    """Plain text: m l^2 theta''."""

    bars = False

    def symbol(self, s):
        plain = s.index.replace(",", "").isdigit()
        index = f"_{s.index}" if s.index and not plain else s.index
        return f"{s.stem}{index}{chr(39) * s.dots}"

    def number(self, x):
        return str(x) if isinstance(x, int | Fraction) else f"{x:.15g}"

    def fraction(self, above, below, single, last):
        if above.isdigit() and below.isdigit():
            return f"{above}/{below}"
        below = below if single else f"({below})"
        return f"{above}/{below}" if last else f"({above}/{below})"

    def power(self, base, exponent):
        return f"{base}^{exponent}" if exponent.isalnum() else f"{base}^({exponent})"

    def root(self, x):
        return f"sqrt({x})"

    def brackets(self, x):
        return f"({x})"

    def call(self, op, args, exponent, plain):
        del plain
        if op == "abs":
            return self.power(f"|{args[0]}|", exponent) if exponent else f"|{args[0]}|"
        return f"{_NAMES.get(op, op)}{f'^{exponent}' if exponent else ''}({', '.join(args)})"

    def choice(self, condition, yes, no):
        return f"({yes} if {condition} else {no})"

    def product(self, factors):
        return " ".join(factors)

    def sum(self, terms):
        if not terms:
            return "0"
        (negative, first), *others = terms
        return (
            ("-" if negative else "")
            + first
            + "".join(f" {'-' if minus else '+'} {term}" for minus, term in others)
        )

    def relation(self, left, sign, right):
        return f"{left} {sign} {right}"

    def matrix(self, rows):
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ("   ".join(x.ljust(w) for x, w in zip(row, widths, strict=True)) for row in rows)
        return "\n".join(f"[ {line} ]" for line in lines)


_NAMES = {"sign": "sgn", "step": "H", "asin": "arcsin", "acos": "arccos", "atan": "arctan"}


class Latex(Style):
    """LaTeX, for the inside of a formula."""

    def symbol(self, s):
        stem = f"\\{s.stem}" if s.stem in GREEK else s.stem
        if len(s.stem) > 1 and s.stem not in GREEK:
            stem = f"\\mathrm{{{s.stem}}}"
        dotted = f"\\{'d' * s.dots}ot{{{stem}}}" if s.dots else stem
        if not s.index:
            return dotted
        plain = self._index(s.index)
        return f"{dotted}_{{{plain}}}" if len(plain) > 1 else f"{dotted}_{plain}"

    def _index(self, index: str) -> str:
        stem, number = split_name(index)
        if stem in GREEK or (number and len(stem) == 1 and stem.isalpha()):
            return self.symbol(Symbol(index, "short", stem=stem, index=number))
        return f"\\mathrm{{{index}}}" if index.isalpha() and len(index) > 1 else index

    def number(self, x):
        text = Text().number(x)
        mantissa, _, exponent = text.partition("e")
        return f"{mantissa} \\cdot 10^{{{int(exponent)}}}" if exponent else text

    def fraction(self, above, below, single, last):
        return f"\\frac{{{above}}}{{{below}}}"

    def power(self, base, exponent):
        return f"{base}^{{{exponent}}}" if len(exponent) > 1 else f"{base}^{exponent}"

    def root(self, x):
        return f"\\sqrt{{{x}}}"

    def brackets(self, x):
        return f"\\left({x}\\right)"

    def call(self, op, args, exponent, plain):
        power = self.power("", exponent) if exponent else ""
        if op == "abs":
            return f"\\left|{args[0]}\\right|{power}"
        known = {"asin", "acos", "atan"}
        name = f"\\{_NAMES[op]}" if op in known else f"\\{op}"
        if op not in _OF_LATEX and op not in known:
            name = f"\\operatorname{{{_NAMES.get(op, op)}}}"
        inner = ", ".join(args)
        return f"{name}{power} {inner}" if plain else f"{name}{power}\\left({inner}\\right)"

    def choice(self, condition, yes, no):
        return (
            f"\\begin{{cases}} {yes} & {condition} \\\\ {no} & \\text{{otherwise}} \\end{{cases}}"
        )

    def product(self, factors):
        return " ".join(factors)

    def sum(self, terms):
        return Text().sum(terms)

    def relation(self, left, sign, right):
        sign = {"<=": "\\le", ">=": "\\ge", "!=": "\\ne"}.get(sign, sign)
        return f"{left} {sign} {right}"

    def matrix(self, rows):
        body = " \\\\ ".join(" & ".join(row) for row in rows)
        return f"\\begin{{pmatrix}} {body} \\end{{pmatrix}}"


#: Functions whose argument needs no brackets if it is a single symbol.
_PLAIN = frozenset({"sin", "cos", "tan", "sinh", "cosh", "tanh", "log"})
_OF_LATEX = frozenset({"sin", "cos", "tan", "exp", "log", "sinh", "cosh", "tanh", "max", "min"})


_MINUS = "&#x2212;"


class MathML(Style):
    """MathML Core, for the inside of a <math> element."""

    def symbol(self, s):
        greek = s.stem in GREEK
        name = f"&{s.stem};" if greek else html.escape(s.stem)
        stem = f"<mi>{name}</mi>"
        if s.dots:
            # Not as accents, which overlap the letter if no mathematical font is installed.
            stem = f'<mover>{stem}<mo stretchy="false">{"." * s.dots}</mo></mover>'
        if not s.index:
            return stem
        inner, number = split_name(s.index)
        if inner in GREEK:
            index = self.symbol(Symbol(s.index, "short", stem=inner, index=number))
            return f"<msub>{stem}<mrow>{index}</mrow></msub>"
        tag = "mn" if s.index.isdigit() else "mi"
        return f"<msub>{stem}<{tag}>{html.escape(s.index)}</{tag}></msub>"

    def number(self, x):
        return f"<mn>{Text().number(x)}</mn>"

    def fraction(self, above, below, single, last):
        return f"<mfrac><mrow>{above}</mrow><mrow>{below}</mrow></mfrac>"

    def power(self, base, exponent):
        inner = exponent if exponent.startswith("<") else f"<mn>{exponent}</mn>"
        if base.startswith("<msub>") and base.count("<msub>") == 1 and base.endswith("</msub>"):
            return f"<msubsup>{base[6:-7]}<mrow>{inner}</mrow></msubsup>"
        return f"<msup><mrow>{base}</mrow><mrow>{inner}</mrow></msup>"

    def root(self, x):
        return f"<msqrt>{x}</msqrt>"

    def brackets(self, x):
        return f"<mrow><mo>(</mo>{x}<mo>)</mo></mrow>"

    def call(self, op, args, exponent, plain):
        inner = "<mo>,</mo>".join(args)
        if op == "abs":
            found = f"<mrow><mo>|</mo>{inner}<mo>|</mo></mrow>"
            return self.power(found, exponent) if exponent else found
        name = f"<mi>{_NAMES.get(op, op)}</mi>"
        name = f"<msup>{name}<mn>{exponent}</mn></msup>" if exponent else name
        # Browsers put no space between the name of a function and its argument.
        inner = f'<mspace width="0.17em"/>{inner}' if plain else self.brackets(inner)
        return f"<mrow>{name}<mo>&#x2061;</mo>{inner}</mrow>"

    def choice(self, condition, yes, no):
        rows = (f"<mtr><mtd>{yes}</mtd><mtd>{condition}</mtd></mtr>", "")
        other = f"<mtr><mtd>{no}</mtd><mtd><mtext>otherwise</mtext></mtd></mtr>"
        return f"<mrow><mo>{{</mo><mtable>{rows[0]}{other}</mtable></mrow>"

    def product(self, factors):
        return '<mo lspace="0.1em" rspace="0.1em">&#x2062;</mo>'.join(factors)

    def sum(self, terms):
        if not terms:
            return "<mn>0</mn>"
        (negative, first), *others = terms
        start = f"<mo>{_MINUS}</mo>" if negative else ""
        return start + first + "".join(f"<mo>{_MINUS if m else '+'}</mo>{x}" for m, x in others)

    def relation(self, left, sign, right):
        sign = {"<=": "&#x2264;", ">=": "&#x2265;", "!=": "&#x2260;", "<": "&lt;"}.get(sign, sign)
        return f"{left}<mo>{sign}</mo>{right}"

    def matrix(self, rows):
        cells = ("".join(f"<mtd>{x}</mtd>" for x in row) for row in rows)
        table = "".join(f"<mtr>{row}</mtr>" for row in cells)
        return f"<mrow><mo>(</mo><mtable>{table}</mtable><mo>)</mo></mrow>"


TEXT, LATEX, MATHML = Text(), Latex(), MathML()
