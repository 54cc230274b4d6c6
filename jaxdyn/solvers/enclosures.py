"""Bounds of a calculation and of its derivatives over boxes, by interval arithmetic.

Each number of a `graph.Graph` becomes a pair (low, high) between which it surely is while the
unknowns run through a box, and so does each of its derivatives. Every result is widened by its
rounding, so the bounds hold for real numbers; underflow alone is not accounted for. All boxes are
worked on at once, in NumPy.

Bounds may be wide: x - x over [0, 1] is [-1, 1], since nothing is known of how its terms are
related. They shrink in proportion to the box. A division by an interval that contains 0 gives the
whole line.

Reference: Moore, Kearfott, Cloud (2009), Introduction to Interval Analysis.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jaxdyn.solvers.formulas import NotElementary
from jaxdyn.solvers.graph import LOGIC, Node, Number

_ROUNDING = 2.0**-52  # relative: of one operation, and of the product that widens
_FUNCTION = 2.0**-50  # relative: of an elementary function, 4 units in the last place


class Interval(NamedTuple):
    """Numbers between low and high, arrays of one shape."""

    low: np.ndarray
    high: np.ndarray


class Dual(NamedTuple):
    """A number (cells,) over each of some boxes, and its derivatives (n, cells)."""

    value: Interval
    slope: Interval


def enclosures(rates: Sequence[Number], inputs: dict[Node, Dual], cells: int) -> list[Dual]:
    """Bounds of numbers over boxes.

    Args:
      rates: the numbers.
      inputs: bounds of the nodes they depend on, (cells,) and (n, cells).
      cells: how many boxes there are.
    Raises:
      NotElementary: an operation without bounds.
    """
    n = next(iter(inputs.values())).slope.low.shape[0]
    found: dict[Node, Dual] = dict(inputs)

    def bound(x: Number) -> Dual:
        if isinstance(x, Node):
            return found[x]
        return Dual(_point(np.full(cells, float(x))), _point(np.zeros((n, cells))))

    with np.errstate(all="ignore"):
        for node in _in_order(rates, inputs):
            if node.op not in _RULES:
                raise NotElementary(node.op)
            found[node] = _RULES[node.op](node, bound)
        return [bound(x) for x in rates]


def _in_order(rates: Sequence[Number], known: dict[Node, Dual]) -> list[Node]:
    """The nodes that the numbers need, each after those it is made of."""
    seen: set[Node] = set()
    todo = [x for x in rates if isinstance(x, Node)]
    while todo:
        node = todo.pop()
        if node in seen or node in known:
            continue
        seen.add(node)
        todo += [x for x in node.args if isinstance(x, Node)]
    return sorted(seen, key=lambda node: node.index)


# ---- intervals


def _point(x: np.ndarray) -> Interval:
    return Interval(x, x)


def _widened(low: np.ndarray, high: np.ndarray, by: float = _ROUNDING) -> Interval:
    """Bounds with what rounding may have done to them; NaN, as of infinity by 0, is no bound."""
    low, high = low - by * np.abs(low), high + by * np.abs(high)
    return Interval(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))


def add(a: Interval, b: Interval) -> Interval:
    """Bounds of a sum."""
    return _widened(a.low + b.low, a.high + b.high)


def negative(a: Interval) -> Interval:
    """Bounds of minus a number."""
    return Interval(-a.high, -a.low)


def multiply(a: Interval, b: Interval) -> Interval:
    """Bounds of a product."""
    # 0 times infinity is 0 here: an infinite bound stands for numbers, all of them finite.
    corners = [np.where((x == 0) | (y == 0), 0.0, x * y) for x in a for y in b]
    low = np.minimum(np.minimum(corners[0], corners[1]), np.minimum(corners[2], corners[3]))
    high = np.maximum(np.maximum(corners[0], corners[1]), np.maximum(corners[2], corners[3]))
    return _widened(low, high)


def _inverse(a: Interval) -> Interval:
    inside = (a.low <= 0) & (a.high >= 0)
    low, high = np.where(inside, -np.inf, 1 / a.high), np.where(inside, np.inf, 1 / a.low)
    # One-sided where 0 is a bound, as of a distance.
    high = np.where((a.low > 0) | (a.high < 0), high, np.inf)
    low = np.where((a.low == 0) & (a.high > 0), 1 / a.high, low)
    high = np.where((a.high == 0) & (a.low < 0), 1 / a.low, high)
    return _widened(low, high)


def _whole_power(a: Interval, n: int) -> Interval:
    low, high = a.low**n, a.high**n
    if n % 2 == 0:
        low, high = np.minimum(low, high), np.maximum(low, high)
        low = np.where((a.low < 0) & (a.high > 0), 0.0, low)
    return _widened(low, high, n * _FUNCTION)


def _hull(a: Interval, b: Interval) -> Interval:
    return Interval(np.minimum(a.low, b.low), np.maximum(a.high, b.high))


def _rising(fn: Callable, a: Interval) -> Interval:
    """Bounds of a function that rises; where it has no value, none are known."""
    return _widened(fn(a.low), fn(a.high), _FUNCTION)


def _cosine(a: Interval, shift: float) -> Interval:
    """Bounds of cos(a - shift pi), shift 0 or 1/2: 1 at even multiples of pi, -1 at odd ones."""
    ends = [np.cos(x) if shift == 0 else np.sin(x) for x in a]
    low, high = _widened(np.minimum(*ends), np.maximum(*ends), _FUNCTION)
    # In turns, widened: a multiple of pi too many only makes bounds wider.
    first, last = _widened(a.low / np.pi - shift, a.high / np.pi - shift, 8 * _FUNCTION)
    first, last = first - _FUNCTION, last + _FUNCTION
    high = np.where(2 * np.floor(last / 2) >= first, 1.0, high)
    low = np.where(2 * np.floor((last - 1) / 2) + 1 >= first, -1.0, low)
    unknown = ~(np.isfinite(first) & np.isfinite(last))
    return Interval(
        np.where(unknown, -1.0, np.maximum(low, -1.0)),
        np.where(unknown, 1.0, np.minimum(high, 1.0)),
    )


# ---- with derivatives

Bound = Callable[[Number], Dual]


def _times(a: Dual, b: Dual) -> Dual:
    slope = add(_along(a.slope, b.value), _along(b.slope, a.value))
    return Dual(multiply(a.value, b.value), slope)


def _along(slope: Interval, factor: Interval) -> Interval:
    return multiply(slope, Interval(factor.low[None], factor.high[None]))


def _through(value: Interval, slope: Interval, of: Dual) -> Dual:
    """A function with this value and slope at a number."""
    return Dual(value, _along(of.slope, slope))


def _plus(a: Dual, b: Dual) -> Dual:
    return Dual(add(a.value, b.value), add(a.slope, b.slope))


def _sum(node: Node, bound: Bound) -> Dual:
    total = bound(0.0)
    for factor, term in zip(node.args[::2], node.args[1::2], strict=True):
        part = bound(factor) if term is None else _scaled(factor, term, bound)
        total = _plus(total, part)
    return total


def _scaled(factor: Number, term: Number, bound: Bound) -> Dual:
    if isinstance(factor, Node):  # such as a condition, which differs from box to box
        return _times(bound(factor), bound(term))
    return Dual(*(_by_number(factor, part) for part in bound(term)))


def _by_number(factor: float, a: Interval) -> Interval:
    """`multiply` by a known number, in a fifth of the time."""
    ends = a if factor >= 0 else a[::-1]
    return _widened(*(factor * x for x in ends))


def _product(node: Node, bound: Bound) -> Dual:
    total = bound(1.0)
    for factor in dict.fromkeys(node.args):
        n, a = node.args.count(factor), bound(factor)
        if n > 1:  # a square is never negative, a product of two numbers may be
            slope = multiply(_whole_power(a.value, n - 1), _point(np.full_like(a.value.low, n)))
            a = _through(_whole_power(a.value, n), slope, a)
        total = _times(total, a)
    return total


def _division(node: Node, bound: Bound) -> Dual:
    a, b = map(bound, node.args)
    inverse = _inverse(b.value)
    return _times(a, _through(inverse, negative(_whole_power(inverse, 2)), b))


def _root(node: Node, bound: Bound) -> Dual:
    (a,) = map(bound, node.args)
    value = _rising(np.sqrt, Interval(np.maximum(a.value.low, 0.0), a.value.high))
    return _through(value, _inverse(add(value, value)), a)


def _power(node: Node, bound: Bound) -> Dual:
    a, n = bound(node.args[0]), node.args[1]
    if isinstance(n, Node):
        raise NotElementary("a power whose exponent is computed")
    return _through(_real_power(a.value, n), _by_number(n, _real_power(a.value, n - 1)), a)


def _real_power(a: Interval, n: float) -> Interval:
    """Of a number that is not negative; of one that may be nothing is known."""
    ends = a.low**n, a.high**n
    low, high = np.minimum(*ends), np.maximum(*ends)
    unknown = a.low < 0
    low, high = np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high)
    return _widened(low, high, _FUNCTION)


def _sine(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    return _through(_cosine(a.value, 0.5), _cosine(a.value, 0.0), a)


def _cos(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    return _through(_cosine(a.value, 0.0), negative(_cosine(a.value, 0.5)), a)


def _exp(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    value = _rising(np.exp, a.value)
    return _through(value, value, a)


def _log(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    return _through(_rising(np.log, a.value), _inverse(a.value), a)


def _tanh(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    value = _rising(np.tanh, a.value)
    slope = add(_point(np.ones_like(value.low)), negative(_whole_power(value, 2)))
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
        either = _hull(no, yes)
        return Interval(
            *(
                np.where(never, a, np.where(always, b, c))
                for a, b, c in zip(no, yes, either, strict=True)
            )
        )

    # Where the choice may change within a box, the number may jump: no derivative is known.
    slope = chosen(no.slope, yes.slope)
    open_ = ~(never | always)
    slope = Interval(np.where(open_, -np.inf, slope.low), np.where(open_, np.inf, slope.high))
    return Dual(chosen(no.value, yes.value), slope)


_RULES: dict[str, Callable[[Node, Bound], Dual]] = {
    **{
        "sum": _sum,
        "scale": lambda node, bound: _scaled(*node.args, bound),
        "add": lambda node, bound: _plus(*map(bound, node.args)),
    },
    **{"product": _product, "mul": _product, "div": _division, "sqrt": _root, "pow": _power},
    **{"sin": _sine, "cos": _cos, "exp": _exp, "log": _log, "tanh": _tanh},
    **{"eq": _equal, "ne": _equal, **dict.fromkeys(LOGIC, _logic), "select": _select},
    "real": lambda node, bound: bound(node.args[0]),
}
