"""The shortest of several forms of an expression."""

from jaxdyn.symbolic.algebra import (
    ONE,
    Call,
    Expression,
    Group,
    Monomial,
    factors_in,
    inverse,
    sums_in,
    times,
)
from jaxdyn.symbolic.trigonometry import shorten_deeply


def simplify(x: Expression) -> Expression:
    """An expression with the fewest terms.

    The candidates are the forms with differences in brackets, multiplied out, and over common
    denominators; in each, sums that occur in brackets elsewhere are put into brackets.
    """
    plain = shorten_deeply(x)
    forms = [plain, shorten_deeply(plain.expand())]
    forms.append(shorten_deeply(forms[-1].over_one_line()))
    return min((reuse_differences(form) for form in forms), key=lambda form: len(form.terms))


def reuse_differences(x: Expression) -> Expression:
    """k x1 - k x2 as k (x1 - x2), if x1 - x2 occurs in brackets elsewhere."""
    for bracket in sorted(_differences(x), key=lambda x: x.key):
        while found := with_sum(x, bracket.sum):
            cofactor, rest, c = found
            if not cofactor:
                break
            x = rest + Expression({cofactor: c}) * Expression({((bracket, ONE),): ONE})
    return x


def with_sum(x: Expression, part: Expression) -> tuple[Monomial, Expression, object] | None:
    """The factor and number by which a sum occurs in another one, and the rest of the latter."""
    first, *others = part.terms.items()
    for m, c in x.terms.items():
        cofactor = _quotient(m, first[0])
        if cofactor is None:
            continue
        scale = c / first[1]
        wanted = {m: c} | {times(cofactor, n): scale * d for n, d in others}
        if all(x.terms.get(n) == d for n, d in wanted.items()):
            rest = Expression({n: d for n, d in x.terms.items() if n not in wanted})
            return cofactor, rest, scale
    return None


def _differences(x: Expression) -> set[Group]:
    """The differences in brackets, and those whose absolute value or sign is taken."""
    found = set()
    for a, _ in factors_in(x):
        for y in sums_in(a):
            if isinstance(a, Group) and y.is_difference:
                found.add(a)
            elif isinstance(a, Call) and a.op in ("abs", "sign") and y.is_difference:
                found.add(Group(y * (1 if y.leading > 0 else -1)))
    return found


def _quotient(m: Monomial, n: Monomial) -> Monomial | None:
    """m / n, if n divides it."""
    powers = dict(m)
    divides = all(powers.get(a, 0) >= e for a, e in n)
    return times(m, inverse(n)) if divides else None
