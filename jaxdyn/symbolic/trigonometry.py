"""Sums shortened by trigonometric identities: Pythagoras', and those for sums of angles."""

from collections.abc import Iterator
from fractions import Fraction

from jaxdyn.symbolic.algebra import (
    Atom,
    Call,
    Coefficient,
    Expression,
    Group,
    Monomial,
    function,
    times,
)


def shorten(x: Expression) -> Expression:
    """The sum with pairs of terms combined until no pair is left that can be.

    sin^2 a + cos^2 a becomes 1, 1 - sin^2 a becomes cos^2 a, and two products of sines and cosines
    of two angles become the sine or cosine of their sum or difference.
    """
    terms = dict(x.terms)
    for rule in (_squares, _angles, _from_one):
        while found := next(rule(terms), None):
            gone, new = found
            for m in gone:
                del terms[m]
            for m, c in new.terms.items():
                terms[m] = terms.get(m, 0) + c
                if terms[m] == 0:
                    del terms[m]
    return Expression(terms)


def shorten_deeply(x: Expression) -> Expression:
    """The same, applied inside brackets too, also in those of arguments."""

    def inside(a: Atom) -> Expression | None:
        if isinstance(a, Group):
            return shorten(a.sum.replace(inside))
        return None

    return shorten(x.replace(inside))


#: The monomials that are removed, and the terms that replace them.
_Found = tuple[tuple[Monomial, ...], Expression]


def _squares(terms: dict[Monomial, Coefficient]) -> Iterator[_Found]:
    """c sin^2 a R + c cos^2 a R = c R."""
    for m, c in terms.items():
        for a, rest in _without(m, "sin", 2):
            other = _with(rest, Call("cos", *a.args), 2)
            if terms.get(other) == c:
                yield (m, other), Expression({rest: c})


def _from_one(terms: dict[Monomial, Coefficient]) -> Iterator[_Found]:
    """c R - c sin^2 a R = c cos^2 a R, and with sine and cosine exchanged."""
    for m, c in terms.items():
        for op, other in (("sin", "cos"), ("cos", "sin")):
            for a, rest in _without(m, op, 2):
                if terms.get(rest) == -c:
                    yield (m, rest), Expression({_with(rest, Call(other, *a.args), 2): -c})


def _angles(terms: dict[Monomial, Coefficient]) -> Iterator[_Found]:
    """The sine and cosine of a sum or difference."""
    for m, c in terms.items():
        for a, part in _without(m, "sin", 1):
            # c sin a cos b + d cos a sin b, or c sin a sin b + d cos a cos b
            for of_b, op in (("cos", "sin"), ("sin", "cos")):
                for b, rest in _without(part, of_b, 1):
                    if a.args == b.args:
                        continue
                    other = _with(_with(rest, Call("cos", *a.args), 1), Call(op, *b.args), 1)
                    d = terms.get(other)
                    if d is not None and abs(d) == abs(c):
                        angle = a.args[0] + b.args[0] * (1 if (c == d) == (op == "sin") else -1)
                        size = c if op == "sin" else d
                        yield (m, other), Expression({rest: size}) * function(op, angle)


def _without(m: Monomial, op: str, power: int) -> Iterator[tuple[Call, Monomial]]:
    """Each sine, or cosine, that is a factor in this power, and the other factors."""
    for i, (a, e) in enumerate(m):
        if isinstance(a, Call) and a.op == op and e >= power and e.denominator == 1:
            left = ((a, e - power),) if e > power else ()
            yield a, (*m[:i], *left, *m[i + 1 :])


def _with(m: Monomial, a: Call, power: int) -> Monomial:
    """A monomial with one more factor."""
    return times(m, ((a, Fraction(power)),))
