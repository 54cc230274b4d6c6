"""Bounds of a calculation and of its derivatives over boxes, by interval arithmetic.

Each number of a `graph.Graph` becomes a pair (low, high) that encloses it while the unknowns run
through a box, and so does each of its derivatives (`Interval`). All boxes are processed at once,
in NumPy.

Bounds may be wide: x - x over [0, 1] is [-1, 1], since correlations between terms are ignored.
They shrink in proportion to the box.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jaxdyn.solvers.formulas.graph import LOGIC, Node, NotElementary, Number

# ---- Interval arithmetic: rigorous bounds of numbers, including rounding
#
# Every result is widened by its rounding, so the bounds hold for real numbers; underflow alone is
# not accounted for. An infinite bound encloses finite numbers only, so 0 times it is 0. A division
# by an interval that contains 0 gives the whole line, and so does any unknown result.
#
# Reference: Moore, Kearfott, Cloud (2009), Introduction to Interval Analysis.

ROUNDING = 2.0**-52  # relative error of one operation, and of the product that widens its result
FUNCTION_ROUNDING = 2.0**-50  # relative error of an elementary function, 4 units in the last place


class Interval(NamedTuple):
    """Numbers between low and high, arrays of one shape."""

    low: np.ndarray
    high: np.ndarray


def point(x: np.ndarray) -> Interval:
    """The intervals of known numbers."""
    return Interval(x, x)


def _widen(low: np.ndarray, high: np.ndarray, by: float = ROUNDING) -> Interval:
    """Bounds widened by rounding; NaN, as of infinity times 0, becomes no bound."""
    low, high = low - by * np.abs(low), high + by * np.abs(high)
    return Interval(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))


def add(a: Interval, b: Interval) -> Interval:
    """Bounds of a sum."""
    return _widen(a.low + b.low, a.high + b.high)


def negative(a: Interval) -> Interval:
    """Bounds of minus a number."""
    return Interval(-a.high, -a.low)


def multiply(a: Interval, b: Interval) -> Interval:
    """Bounds of a product."""
    # 0 times infinity is 0 here: an infinite bound encloses finite numbers only.
    corners = [np.where((x == 0) | (y == 0), 0.0, x * y) for x in a for y in b]
    low = np.minimum(np.minimum(corners[0], corners[1]), np.minimum(corners[2], corners[3]))
    high = np.maximum(np.maximum(corners[0], corners[1]), np.maximum(corners[2], corners[3]))
    return _widen(low, high)


def inverse(a: Interval) -> Interval:
    """Bounds of 1 / a, the whole line where a may have either sign."""
    inside = (a.low <= 0) & (a.high >= 0)
    low, high = np.where(inside, -np.inf, 1 / a.high), np.where(inside, np.inf, 1 / a.low)
    # The bound is one-sided where 0 is an end, as for a distance.
    high = np.where((a.low > 0) | (a.high < 0), high, np.inf)
    low = np.where((a.low == 0) & (a.high > 0), 1 / a.high, low)
    high = np.where((a.high == 0) & (a.low < 0), 1 / a.low, high)
    return _widen(low, high)


def whole_power(a: Interval, n: int) -> Interval:
    """Bounds of a^n, n > 0; an even power is not negative."""
    low, high = a.low**n, a.high**n
    if n % 2 == 0:
        low, high = np.minimum(low, high), np.maximum(low, high)
        low = np.where((a.low < 0) & (a.high > 0), 0.0, low)
    return _widen(low, high, n * FUNCTION_ROUNDING)


def hull(a: Interval, b: Interval) -> Interval:
    """Bounds of a number that is in one of two intervals."""
    return Interval(np.minimum(a.low, b.low), np.maximum(a.high, b.high))


def rising(fn: Callable, a: Interval) -> Interval:
    """Bounds of an increasing function; infinite ones where it is undefined."""
    return _widen(fn(a.low), fn(a.high), FUNCTION_ROUNDING)


def cosine(a: Interval, shift: float) -> Interval:
    """Bounds of cos(a - shift pi), shift 0 or 1/2: 1 at even multiples of pi, -1 at odd ones."""
    ends = [np.cos(x) if shift == 0 else np.sin(x) for x in a]
    low, high = _widen(np.minimum(*ends), np.maximum(*ends), FUNCTION_ROUNDING)
    # These count half turns, widened: an extra multiple of pi only makes bounds wider.
    first, last = _widen(a.low / np.pi - shift, a.high / np.pi - shift, 8 * FUNCTION_ROUNDING)
    first, last = first - FUNCTION_ROUNDING, last + FUNCTION_ROUNDING
    high = np.where(2 * np.floor(last / 2) >= first, 1.0, high)
    low = np.where(2 * np.floor((last - 1) / 2) + 1 >= first, -1.0, low)
    unknown = ~(np.isfinite(first) & np.isfinite(last))
    return Interval(
        np.where(unknown, -1.0, np.maximum(low, -1.0)),
        np.where(unknown, 1.0, np.minimum(high, 1.0)),
    )


def by_number(factor: float, a: Interval) -> Interval:
    """The result of `multiply` by a known number, in a fifth of the time."""
    ends = a if factor >= 0 else a[::-1]
    return _widen(*(factor * x for x in ends))


def real_power(a: Interval, n: float) -> Interval:
    """Bounds of a^n for a not negative; the whole line where a may be negative."""
    ends = a.low**n, a.high**n
    low, high = np.minimum(*ends), np.maximum(*ends)
    unknown = a.low < 0
    low, high = np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high)
    return _widen(low, high, FUNCTION_ROUNDING)


# ---- Bounds of a calculation over boxes


class Dual(NamedTuple):
    """A number (cells,) over each of some boxes, and its derivatives (n, cells)."""

    value: Interval
    slope: Interval


def enclosures(rates: Sequence[Number], inputs: dict[Node, Dual], cells: int) -> list[Dual]:
    """Bounds of numbers over boxes.

    Args:
      rates: the numbers.
      inputs: bounds of the nodes they depend on, (cells,) and (n, cells).
      cells: number of boxes.
    Raises:
      NotElementary: an operation without bounds.
    """
    n = next(iter(inputs.values())).slope.low.shape[0]
    found: dict[Node, Dual] = dict(inputs)

    def bound(x: Number) -> Dual:
        if isinstance(x, Node):
            return found[x]
        return Dual(point(np.full(cells, float(x))), point(np.zeros((n, cells))))

    with np.errstate(all="ignore"):
        for node in _in_order(rates, inputs):
            if node.op not in _RULES:
                raise NotElementary(node.op)
            found[node] = _RULES[node.op](node, bound)
        return [bound(x) for x in rates]


def _in_order(rates: Sequence[Number], known: dict[Node, Dual]) -> list[Node]:
    """The nodes that the numbers need, each after its operands."""
    seen: set[Node] = set()
    todo = [x for x in rates if isinstance(x, Node)]
    while todo:
        node = todo.pop()
        if node in seen or node in known:
            continue
        seen.add(node)
        todo += [x for x in node.args if isinstance(x, Node)]
    return sorted(seen, key=lambda node: node.index)


Bound = Callable[[Number], Dual]


def _times(a: Dual, b: Dual) -> Dual:
    slope = add(_along(a.slope, b.value), _along(b.slope, a.value))
    return Dual(multiply(a.value, b.value), slope)


def _along(slope: Interval, factor: Interval) -> Interval:
    return multiply(slope, Interval(factor.low[None], factor.high[None]))


def _through(value: Interval, slope: Interval, of: Dual) -> Dual:
    """The chain rule: a function with this value and slope at a number."""
    return Dual(value, _along(of.slope, slope))


def _plus(a: Dual, b: Dual) -> Dual:
    return Dual(add(a.value, b.value), add(a.slope, b.slope))


def _sum(node: Node, bound: Bound) -> Dual:
    total = bound(0.0)
    for factor, term in zip(node.args[::2], node.args[1::2], strict=True):
        part = bound(factor) if term is None else _scale(factor, term, bound)
        total = _plus(total, part)
    return total


def _scale(factor: Number, term: Number, bound: Bound) -> Dual:
    if isinstance(factor, Node):  # such as a condition, which differs from box to box
        return _times(bound(factor), bound(term))
    return Dual(*(by_number(factor, part) for part in bound(term)))


def _product(node: Node, bound: Bound) -> Dual:
    total = bound(1.0)
    for factor in dict.fromkeys(node.args):
        n, a = node.args.count(factor), bound(factor)
        if n > 1:  # a square is never negative, a product of two numbers may be
            slope = multiply(whole_power(a.value, n - 1), point(np.full_like(a.value.low, n)))
            a = _through(whole_power(a.value, n), slope, a)
        total = _times(total, a)
    return total


def _division(node: Node, bound: Bound) -> Dual:
    a, b = map(bound, node.args)
    one_over = inverse(b.value)
    return _times(a, _through(one_over, negative(whole_power(one_over, 2)), b))


def _root(node: Node, bound: Bound) -> Dual:
    (a,) = map(bound, node.args)
    value = rising(np.sqrt, Interval(np.maximum(a.value.low, 0.0), a.value.high))
    return _through(value, inverse(add(value, value)), a)


def _power(node: Node, bound: Bound) -> Dual:
    a, n = bound(node.args[0]), node.args[1]
    if isinstance(n, Node):
        raise NotElementary("a power whose exponent is computed")
    return _through(real_power(a.value, n), by_number(n, real_power(a.value, n - 1)), a)


def _sine(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    return _through(cosine(a.value, 0.5), cosine(a.value, 0.0), a)


def _cos(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    return _through(cosine(a.value, 0.0), negative(cosine(a.value, 0.5)), a)


def _exp(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    value = rising(np.exp, a.value)
    return _through(value, value, a)


def _log(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    return _through(rising(np.log, a.value), inverse(a.value), a)


def _tanh(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    value = rising(np.tanh, a.value)
    slope = add(point(np.ones_like(value.low)), negative(whole_power(value, 2)))
    return _through(value, slope, a)


def _equal(node: Node, bound: Bound) -> Dual:
    a, b = (bound(x) for x in node.args)
    surely = (a.value.low == b.value.high) & (a.value.high == b.value.low)
    maybe = (a.value.low <= b.value.high) & (b.value.low <= a.value.high)
    surely, maybe = (surely, maybe) if node.op == "eq" else (~maybe, ~surely)
    return Dual(Interval(surely * 1.0, maybe * 1.0), bound(0.0).slope)


def _logic(node: Node, bound: Bound) -> Dual:
    args = [bound(x).value for x in node.args]
    if node.op == "not":
        (a,) = args
        return Dual(Interval(1.0 - a.high, 1.0 - a.low), bound(0.0).slope)
    both = [LOGIC[node.op](*(x[i] > 0 for x in args)) * 1.0 for i in range(2)]
    return Dual(Interval(*both), bound(0.0).slope)


def _select(node: Node, bound: Bound) -> Dual:
    which, no, yes = map(bound, node.args)
    never, always = which.value.high == 0, which.value.low == 1

    def chosen(no: Interval, yes: Interval) -> Interval:
        either = hull(no, yes)
        return Interval(
            *(
                np.where(never, a, np.where(always, b, c))
                for a, b, c in zip(no, yes, either, strict=True)
            )
        )

    # Where the choice may change within a box, the number may jump: no derivative exists.
    slope = chosen(no.slope, yes.slope)
    open_ = ~(never | always)
    slope = Interval(np.where(open_, -np.inf, slope.low), np.where(open_, np.inf, slope.high))
    return Dual(chosen(no.value, yes.value), slope)


_RULES: dict[str, Callable[[Node, Bound], Dual]] = {
    **{
        "sum": _sum,
        "scale": lambda node, bound: _scale(node.args[0], node.args[1], bound),
        "add": lambda node, bound: _plus(bound(node.args[0]), bound(node.args[1])),
    },
    **{"product": _product, "mul": _product, "div": _division, "sqrt": _root, "pow": _power},
    **{"sin": _sine, "cos": _cos, "exp": _exp, "log": _log, "tanh": _tanh},
    **{"eq": _equal, "ne": _equal, **dict.fromkeys(LOGIC, _logic), "select": _select},
    "real": lambda node, bound: bound(node.args[0]),
}
