"""Readable sums: common factors in front of brackets, and names for lengths.

The results of these functions are for printing and evaluation; further arithmetic would multiply
their brackets out again.
"""

import itertools
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from fractions import Fraction

from jaxdyn.symbolic.algebra import (
    ONE,
    Atom,
    Call,
    Coefficient,
    Expression,
    Group,
    Monomial,
    Symbol,
    as_expression,
    content_of,
    factors_in,
    in_order,
    inverse,
    number,
    symbols_of,
    times,
)
from jaxdyn.symbolic.simplifying import with_sum

_OF_STATE = frozenset({"coordinate", "velocity", "rate", "acceleration"})
#: Letters for the roots of sums of squares of velocities.
_SPEEDS = ("v", "u")
_OUTER = ("acceleration", "rate", "multiplier")


def depends_on_state(a: Atom) -> bool:
    """Whether an atom depends on the state."""
    return any(s.kind in _OF_STATE for s in symbols_of(a))


def collect(x: Expression) -> Expression:
    """Terms with the same moving factor collected, with coefficients in brackets: (m1 + m2) x''."""
    x = _with_stretches(_with_closing_speeds(_with_squares(x)))
    for key in (_along_speeds, _outer, _motion, _lengths, _beside_velocities):
        x = _unite(_with_differences(x), key)
    return _with_steady(x)


def _with_squares(x: Expression) -> Expression:
    """Sums a^2 + 2 a b + b^2 of products a and b as (a + b)^2."""
    for m, n in itertools.combinations(x.terms, 2):
        c = x.terms[m]
        powers = {k: dict(k) for k in (m, n)}
        common = in_order(
            {a: min(p.get(a, Fraction(0)) for p in powers.values()) for a in powers[m] | powers[n]}
        )
        a, b = (_root_of(times(k, inverse(common))) for k in (m, n))
        if x.terms[n] != c or a is None or b is None:
            continue
        if min(len(a), len(b)) < 2 and not (_is_fixed(a) and _is_fixed(b) and a and b):
            continue
        cross = times(times(common, a), b)
        ratio = x.terms.get(cross, 0) / (2 * c)
        if abs(ratio) == 1:
            left = {k: d for k, d in x.terms.items() if k not in (m, n, cross)}
            square = ((Group(Expression({a: ONE, b: ratio})), Fraction(2)),)
            return _with_squares(Expression(left | {times(common, square): c}))
    return x


def _with_stretches(x: Expression) -> Expression:
    """Springs on a line: k (x1 - x2) - k l sgn(x1 - x2) as k (|x1 - x2| - l) sgn(x1 - x2)."""
    for n, d in x.terms.items():
        for side in [a for a, _ in n if isinstance(a, Call) and a.op == "sign"]:
            (displacement,) = side.args
            whole = (
                Group(displacement)
                if len(displacement.terms) > 1
                else next(iter(displacement.terms))[0][0]
            )
            rest = times(n, ((side, -ONE),))
            for m, c in x.terms.items():
                ratio = dict(times(rest, inverse(times(m, ((whole, -ONE),)))))
                if n == m or min(ratio.values(), default=-1) < 0:
                    continue
                left = {k: v for k, v in x.terms.items() if k not in (m, n)}
                size = ((Call("abs", displacement), ONE),)
                stretch = Expression({size: ONE, in_order(ratio): d / c})
                spring = times(m, ((whole, -ONE), (side, ONE), (Group(stretch), ONE)))
                return _with_stretches(Expression(left | {spring: c}))
    return x


def _along_speeds(m: Monomial) -> Monomial | None:
    """One over the speed, which terms of friction along a velocity share."""
    speeds = tuple((a, e) for a, e in m if e == -1 and _is_short(a, e) and _is_speed(a))
    return speeds or None


def _is_speed(a: Atom) -> bool:
    return isinstance(a, Symbol) and a.stem in _SPEEDS


def _with_closing_speeds(x: Expression) -> Expression:
    """Terms of dampers along lines: c x^2 x' / r^2 + c x y y' / r^2 as c (x x' + y y') x / r^2."""

    def pair_of(m: Monomial) -> Monomial | None:
        pair = _beside_own_velocity(m)
        along = pair and any(_is_short(a, e) and e < 0 for a, e in times(m, inverse(pair)))
        return pair if along else None

    return _in_brackets(x, pair_of)


def _in_brackets(x: Expression, part_of: Callable[[Monomial], Monomial | None]) -> Expression:
    """A sum whose terms that differ only in a part, up to signs, have these parts in brackets."""
    parts: dict[tuple, dict[Monomial, Coefficient]] = {}
    found: dict[Monomial, Coefficient] = {}
    for m, c in x.terms.items():
        part = part_of(m)
        if part is None:
            found[m] = c
        else:
            parts.setdefault((times(m, inverse(part)), abs(c)), {})[part] = c / abs(c)
    for (rest, c), terms in parts.items():
        if len(terms) == 1:
            ((part, sign),) = terms.items()
            found[times(rest, part)] = c * sign
            continue
        sign = -1 if all(d < 0 for d in terms.values()) else 1
        found[times(rest, ((Group(Expression(terms) * sign), ONE),))] = c * sign
    return Expression(found)


def _beside_own_velocity(m: Monomial) -> Monomial | None:
    """A velocity and its coordinate in a term, or differences of velocities and of coordinates."""
    moving = [(a, e) for a, e in m if _of_kind(a, "velocity")]
    if len(moving) != 1 or moving[0][1] != 1:
        return None
    v = moving[0][0]
    for a, e in m:
        whole = e >= 1 and e.denominator == 1
        if whole and _of_kind(a, "coordinate") and _places_of(a) & _places_of(v):
            return in_order({a: ONE, v: ONE})
    return None


def _of_kind(a: Atom, kind: str) -> bool:
    """Whether an atom is a symbol of this kind, or a difference that begins with one."""
    if isinstance(a, Symbol):
        return a.kind == kind
    return isinstance(a, Group) and a.sum.is_difference and kind in {s.kind for s in symbols_of(a)}


def _places_of(a: Atom) -> set[tuple[str, str]]:
    return {(s.stem, s.index) for s in symbols_of(a) if s.kind in ("coordinate", "velocity")}


def _root_of(m: Monomial) -> Monomial | None:
    """The square root of a monomial of even powers."""
    even = all(e.denominator == 1 and e % 2 == 0 for _, e in m)
    return tuple((a, e / 2) for a, e in m) if even else None


def _with_steady(x: Expression) -> Expression:
    """Factors that the constant terms share, in front of brackets, beside the moving terms."""
    steady = {m: c for m, c in x.terms.items() if _is_fixed(m)}
    if not 1 < len(steady) < len(x.terms):
        return x
    content, common, inner = split_common(Expression(steady))
    if not common:
        return x
    moving = {m: c for m, c in x.terms.items() if m not in steady}
    return Expression(moving | {times(common, ((Group(inner), ONE),)): content})


def of_energy(x: Expression) -> Expression:
    """An energy collected by squares of velocities, those with equal coefficients together."""
    for key in (_velocities, _motion, _lengths):
        x = _unite(x, key)
    return gather_squares(_with_halves(x))


def of_momentum(x: Expression) -> Expression:
    """A momentum collected by velocities, each with its whole coefficient."""
    return _unite(x, lambda m: tuple((a, e) for a, e in m if _is_velocity(a)) or None)


def of_points(x: Expression) -> Expression:
    """A momentum of points collected by their masses: m (x y' - y x')."""
    return _unite(x, lambda m: tuple(f for f in m if not depends_on_state(f[0])) or None)


def _with_halves(x: Expression) -> Expression:
    """A half taken out of brackets before the square of a velocity: m (1 + a) x'^2 / 2."""
    found: dict[Monomial, Coefficient] = {}
    for m, c in x.terms.items():
        brackets = [a for a, e in m if isinstance(a, Group) and e == 1]
        if _velocities(m) and len(brackets) == 1:
            inner = brackets[0].sum
            if c == 1 and any(Fraction(d).denominator % 2 == 0 for d in inner.terms.values()):
                m = tuple((Group(inner * 2), e) if a is brackets[0] else (a, e) for a, e in m)
                c = Fraction(1, 2)
        found[m] = c
    return Expression(found)


def factor_common(x: Expression) -> Expression:
    """An expression with the factor that all terms share in front of brackets."""
    if len(x.terms) < 2:
        return collect(x)
    content, common, inner = split_common(x)
    if not common:
        return collect(x)
    return Expression({times(common, ((Group(inner), ONE),)): content})


def factor_shared(x: Expression) -> Expression:
    """The same as `factor_common`, but quotients of lengths stay in the brackets."""
    if len(x.terms) < 2:
        return collect(x)
    content, common, inner = split_common(x, _beside_lengths)
    brackets = () if inner == number(1) else ((Group(inner), ONE),)
    return Expression({times(common, brackets): content}) if common else inner * content


def _velocities(m: Monomial) -> Monomial | None:
    """The square of a velocity in a term."""
    found = tuple((a, e) for a, e in m if _is_velocity(a))
    return found if len(found) == 1 and found[0][1] == 2 else None


def _lengths(m: Monomial) -> Monomial | None:
    """The lengths in a term without motion."""
    if any(depends_on_state(a) and not _is_length(a, e) for a, e in m):
        return None
    return tuple((a, e) for a, e in m if _is_short(a, e)) or None


def _with_differences(x: Expression) -> Expression:
    """Positions with equal coefficients in brackets: k (x2 - x1)."""

    def places_of(m: Monomial) -> Monomial | None:
        places = tuple((a, e) for a, e in m if isinstance(a, Symbol) and a.kind == "coordinate")
        rest = times(m, inverse(places))
        steady = not any(depends_on_state(a) or _is_short(a, e) for a, e in rest)
        return places if places and rest and steady else None

    return _in_brackets(x, places_of)


def _outer(m: Monomial) -> Monomial | None:
    """The second derivative, or the multiplier, in a term."""
    found = tuple((a, e) for a, e in m if isinstance(a, Symbol) and a.kind in _OUTER)
    return found or None


def _motion(m: Monomial) -> Monomial | None:
    """The moving factors of a term, without lengths and their powers."""
    found = tuple((a, e) for a, e in m if depends_on_state(a) and not _is_length(a, e))
    return found or None


def _beside_velocities(m: Monomial) -> Monomial | None:
    """The coefficient of the velocities in a term, if this coefficient has several factors."""
    left = tuple((a, e) for a, e in m if not _is_velocity(a))
    return left if len(left) > 1 and len(left) < len(m) and _outer(m) is None else None


def _is_velocity(a: Atom) -> bool:
    return isinstance(a, Symbol) and a.kind == "velocity"


def _is_length(a: Atom, e: Fraction) -> bool:
    """Whether a factor is a root, or in the denominator."""
    return isinstance(a, Group) and (e.denominator > 1 or e < 0)


def _unite(x: Expression, key: Callable[[Monomial], Monomial | None]) -> Expression:
    """A sum with terms that share a part collected: the part in front of brackets with the rest."""
    parts: dict[Monomial, dict[Monomial, Coefficient]] = {}
    found: dict[Monomial, Coefficient] = {}
    for m, c in x.terms.items():
        part = key(m)
        if part is None:
            found[m] = c
        else:
            rest = tuple(f for f in m if f not in part)
            parts.setdefault(part, {})[rest] = c
    for part, terms in parts.items():
        if len(terms) == 1:
            ((rest, c),) = terms.items()
            found[times(rest, part)] = c
            continue
        for together in _partition(terms):
            content, common, inner = split_common(Expression(together))
            inner = _unite(inner, key) if any(key(m) for m in inner.terms) else inner
            brackets = () if inner == number(1) else ((Group(_with_radii(inner)), ONE),)
            found[times(times(common, part), brackets)] = content
    return Expression(found)


def _with_radii(x: Expression) -> Expression:
    """Moments of inertia of one mass together: I + m d^2 + m s^2 as I + m (d^2 + s^2)."""
    masses: dict[tuple, dict[Monomial, Coefficient]] = {}
    for m, c in x.terms.items():
        square = tuple((a, e) for a, e in m if isinstance(a, Symbol) and e == 2)
        rest = tuple(f for f in m if f not in square)
        if len(square) == 1 and rest:
            masses.setdefault((rest, c), {})[square] = ONE
    for (rest, c), squares in masses.items():
        if 1 < len(squares) < len(x.terms):
            left = {
                m: d for m, d in x.terms.items() if not any(m == times(rest, s) for s in squares)
            }
            x = Expression(left | {times(rest, ((Group(Expression(squares)), ONE),)): c})
    return x


def _partition(terms: dict[Monomial, Coefficient]) -> list[dict[Monomial, Coefficient]]:
    """Groups of related coefficients: k with -k l0 / r, other powers of lengths separately."""
    lengths = {m: tuple((a, e) for a, e in m if _is_short(a, e)) for m in terms}
    if not any(lengths.values()):
        return [terms]
    found: dict[tuple, dict[Monomial, Coefficient]] = {}
    plain = [m for m in terms if not lengths[m]]
    for m, c in terms.items():
        beside = [n for n in plain if n and lengths[m] and set(n) <= set(m)]
        found.setdefault(beside[0] if beside else lengths[m] or m, {})[m] = c
    return list(found.values())


def _is_short(a: Atom, e: Fraction) -> bool:
    return (isinstance(a, Symbol) and a.kind == "short") or _is_length(a, e)


def _least(a: Atom, powers: list[Fraction]) -> Fraction:
    """The least power, which puts all terms over a common denominator."""
    del a
    return min(powers)


def _beside_lengths(a: Atom, powers: list[Fraction]) -> Fraction:
    """The power of a factor that leaves each length in the terms that have it."""
    return _shared_power(powers) if _is_short(a, min(powers)) else min(powers)


def split_common(
    x: Expression, shared_power: Callable[[Atom, list[Fraction]], Fraction] = _least
) -> tuple[Coefficient, Monomial, Expression]:
    """A number and powers that all terms share, and the rest."""
    powers = [dict(m) for m in x.terms]
    shared = {a for m in powers for a in m}
    least = {a: shared_power(a, [m.get(a, Fraction(0)) for m in powers]) for a in shared}
    common = in_order(least)
    content = shared_number(x.terms.values())
    shorts = [
        c for m, c in x.terms.items() if any(_is_short(a, e) for a, e in times(m, inverse(common)))
    ]
    first = shorts or [c for m, c in x.terms.items() if m == common] or list(x.terms.values())
    if all(c < 0 for c in first):
        content = -content
    rest: dict[Monomial, Coefficient] = {}
    for m, (_, c) in zip(powers, x.terms.items(), strict=True):
        left = {a: m.get(a, Fraction(0)) - least.get(a, 0) for a in {*m, *least}}
        key = in_order(left)
        rest[key] = c / content
    return content, common, Expression(rest)


def shared_number(numbers: Collection[Coefficient]) -> Coefficient:
    """The number to take out of a sum: equal in all terms, an integer, or a half."""
    sizes = {abs(c) for c in numbers}
    if len(sizes) == 1:
        return sizes.pop()
    content = content_of(numbers)
    if all(isinstance(c, Fraction) and c.denominator % 2 == 0 for c in numbers):
        return Fraction(1, 2)
    return content if content >= 1 else ONE


def gather_squares(x: Expression) -> Expression:
    """Squares with equal factors collected: m (x'^2 + y'^2) / 2."""
    squares: dict[tuple, dict[Monomial, Coefficient]] = {}
    found: dict[Monomial, Coefficient] = {}
    for m, c in x.terms.items():
        moving = tuple((a, e) for a, e in m if depends_on_state(a))
        even = all(isinstance(a, Symbol) and e.denominator == 1 and e % 2 == 0 for a, e in moving)
        rest = tuple(f for f in m if f not in moving)
        if moving and even:
            squares.setdefault((rest, c), {})[moving] = ONE
        else:
            found[m] = c
    for (rest, c), terms in squares.items():
        if len(terms) == 1:
            found[times(rest, next(iter(terms)))] = c
        else:
            found[times(rest, ((Group(Expression(terms)), ONE),))] = c
    return Expression(found)


def shared_factor(sums: Sequence[Expression]) -> Expression:
    """A number and powers of parameters that all terms of some sums share."""
    content, common = _shared(sums, lambda a: not symbols_of(a) or _is_steady(a))
    return Expression({common: content})


def drop_steady_factors(sums: Sequence[Expression]) -> list[Expression]:
    """Sums without the number and the powers of parameters that all their terms share.

    Parameters that may be 0 are kept: an equation must not be divided by them.
    """
    content, common = _shared(sums, _is_nonzero)
    below = inverse(common)
    return [Expression({times(m, below): c / content for m, c in x.terms.items()}) for x in sums]


def _shared(
    sums: Sequence[Expression], divides: Callable[[Atom], bool]
) -> tuple[Coefficient, Monomial]:
    """A number, and powers of those atoms that may divide, that all terms of some sums share."""
    powers = [dict(m) for x in sums for m in x.terms]
    if not powers:
        return ONE, ()
    atoms = {a for m in powers for a in m if divides(a)}
    least = {a: _shared_power([m.get(a, Fraction(0)) for m in powers]) for a in atoms}
    return shared_number([c for x in sums for c in x.terms.values()]), in_order(least)


def clear_denominators(x: Expression) -> Expression:
    """A sum that is 0 times its denominators that are parameters: x^2 - l^2 for x^2 / l - l."""
    below: dict[Atom, Fraction] = {}
    for m in x.terms:
        for a, e in m:
            if e < 0 and _is_nonzero(a):
                below[a] = min(e, below.get(a, e))
    if not below:
        return x
    over = Expression({in_order(below): shared_number(x.terms.values())})
    return x / over


def _is_nonzero(a: Atom) -> bool:
    """Whether an atom consists of parameters and cannot be 0."""
    if isinstance(a, Group):
        signs = {c > 0 for c in a.sum.terms.values()}
        return len(signs) == 1 and all(_is_nonzero(b) for m in a.sum.terms for b, _ in m)
    return isinstance(a, Symbol) and a.kind == "parameter" and a.positive


def _shared_power(powers: list[Fraction]) -> Fraction:
    """The power that divides all powers, in the numerator or the denominator."""
    return max(min(powers), Fraction(0)) + min(max(powers), Fraction(0))


def _is_fixed(m: Monomial) -> bool:
    """Whether a term contains only parameters."""
    return all(s.kind == "parameter" for a, _ in m for s in symbols_of(a))


def _is_steady(a: Atom) -> bool:
    """Whether an equation may be divided by an atom: a parameter, a length, a sign."""
    return (isinstance(a, Symbol) and a.kind in ("parameter", "short")) or (
        isinstance(a, Call) and a.op == "sign"
    )


def complete_squares(x: Expression) -> Expression:
    """Sums with r^2 - 2 l r + l^2 as (r - l)^2, for lengths r."""
    for m, c in x.terms.items():
        for square, e in m:
            if isinstance(square, Group) and square.sum.is_difference:
                a: Atom = Call("abs", square.sum)
            elif isinstance(square, Symbol) and square.kind == "short":
                a = square
            else:
                continue
            if e != 2:
                continue
            rest = tuple(f for f in m if f[0] is not square)
            for n, d in x.terms.items():
                other = dict(times(n, inverse((*rest, (a, ONE)))))
                if a in other or n == m or min(other.values(), default=Fraction(-1)) < 0:
                    continue
                b = in_order(other)
                last = times(times(rest, b), b)
                ratio = d / (2 * c)
                if x.terms.get(last) == c * ratio * ratio:
                    left = {k: v for k, v in x.terms.items() if k not in (m, n, last)}
                    inner = Expression({((a, ONE),): ONE, b: ratio})
                    square = times(rest, ((Group(inner), Fraction(2)),))
                    return complete_squares(Expression(left)) + Expression({square: c})
    return x


class Lengths:
    """Names for roots of sums that occur more than once: r for sqrt(x^2 + y^2).

    Attributes:
      definitions: their symbols, with the expressions that these stand for.
    """

    def __init__(self, sums: Sequence[Expression], taken: Iterable[Symbol]):
        self._names: dict[Expression, Symbol] = {}
        self.definitions: list[tuple[Symbol, Expression]] = []
        counts: Counter[Expression] = Counter()
        for a, e in (factor for x in sums for factor in factors_in(x)):
            if isinstance(a, Group) and e.denominator == 2 and len(a.sum.terms) > 1:
                counts[a.sum] += 1
        for root in counts:
            counts[root] += sum(with_sum(x, root) is not None for x in sums)
        roots = [x for x, n in counts.items() if n > 1]
        used = {s.name for s in taken}
        stems = Counter(_stem(x) for x in roots)
        for i, x in enumerate(roots):
            stem, index = _stem(x)
            if not index and stems[stem, index] > 1:
                index = str(1 + sum(_stem(y) == (stem, index) for y in roots[:i]))
            while stem + index in used:
                stem = {"r": "d", "d": "s", _SPEEDS[0]: _SPEEDS[1]}.get(stem, f"{stem}_")
            used.add(stem + index)
            symbol = Symbol(stem + index, "short", stem=stem, index=index, rank=i, positive=True)
            self._names[x] = symbol
            self.definitions.append((symbol, x ** Fraction(1, 2)))

    def __call__(self, x: Expression) -> Expression:
        """An expression with the roots replaced by their names."""

        def inside(a: Atom) -> Expression | None:
            return (
                None
                if not isinstance(a, Call)
                else as_expression(Call(a.op, *(factor_common(self(y)) for y in a.args)))
            )

        found = number(0)
        for root, symbol in self._names.items():
            while match := with_sum(x, root):
                cofactor, x, c = match
                found = found + Expression({cofactor: c}) * as_expression(symbol) ** 2
        for m, c in x.terms.items():
            term = number(c)
            for a, e in m:
                if isinstance(a, Group) and a.sum in self._names:
                    term = term * as_expression(self._names[a.sum]) ** (2 * e)
                else:
                    term = term * as_expression(a).replace(inside) ** e
            found = found + term
        return found


def _stem(x: Expression) -> tuple[str, str]:
    """The letter of a length, and its index: the numbers of the points at its ends."""
    moving = sorted((s for s in x.symbols() if s.kind in _OF_STATE), key=lambda s: s.key)
    if any(s.kind == "velocity" for s in moving):
        letter = _SPEEDS[0]
    elif all(s.kind == "coordinate" for s in moving):
        letter = "r"
    else:
        letter = "d"
    indices = sorted({s.index for s in moving})
    return letter, "".join(indices) if all(i.isdigit() for i in indices) else ""
