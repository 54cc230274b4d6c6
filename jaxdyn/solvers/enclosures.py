"""Bounds of formulas and of their derivatives over boxes, by rigorous interval arithmetic.

Each number of a `graph.Graph` becomes an interval that encloses it while the unknowns run through a
box, and so does each of its derivatives. All boxes are processed at once, in NumPy.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jaxdyn.intervals import RIGOROUS, Interval, negative, point
from jaxdyn.solvers.formulas.graph import LOGIC, Node, NotElementary, Number


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
    slope = RIGOROUS.add(_along(a.slope, b.value), _along(b.slope, a.value))
    return Dual(RIGOROUS.multiply(a.value, b.value), slope)


def _along(slope: Interval, factor: Interval) -> Interval:
    return RIGOROUS.multiply(slope, Interval(factor.low[None], factor.high[None]))


def _through(value: Interval, slope: Interval, of: Dual) -> Dual:
    """The chain rule: a function with this value and slope at a number."""
    return Dual(value, _along(of.slope, slope))


def _plus(a: Dual, b: Dual) -> Dual:
    return Dual(RIGOROUS.add(a.value, b.value), RIGOROUS.add(a.slope, b.slope))


def _sum(node: Node, bound: Bound) -> Dual:
    total = bound(0.0)
    for factor, term in zip(node.args[::2], node.args[1::2], strict=True):
        part = bound(factor) if term is None else _scale(factor, term, bound)
        total = _plus(total, part)
    return total


def _scale(factor: Number, term: Number, bound: Bound) -> Dual:
    if isinstance(factor, Node):  # such as a condition, which differs from box to box
        return _times(bound(factor), bound(term))
    return Dual(*(RIGOROUS.scale(factor, part) for part in bound(term)))


def _product(node: Node, bound: Bound) -> Dual:
    total = bound(1.0)
    for factor in dict.fromkeys(node.args):
        n, a = node.args.count(factor), bound(factor)
        if n > 1:  # a square is never negative, a product of two numbers may be
            slope = RIGOROUS.multiply(
                RIGOROUS.whole_power(a.value, n - 1), point(np.full_like(a.value.low, n))
            )
            a = _through(RIGOROUS.whole_power(a.value, n), slope, a)
        total = _times(total, a)
    return total


def _division(node: Node, bound: Bound) -> Dual:
    a, b = map(bound, node.args)
    one_over = RIGOROUS.inverse(b.value)
    return _times(a, _through(one_over, negative(RIGOROUS.whole_power(one_over, 2)), b))


def _root(node: Node, bound: Bound) -> Dual:
    (a,) = map(bound, node.args)
    value = RIGOROUS.root(a.value)
    return _through(value, RIGOROUS.inverse(RIGOROUS.add(value, value)), a)


def _power(node: Node, bound: Bound) -> Dual:
    a, n = bound(node.args[0]), node.args[1]
    if isinstance(n, Node):
        raise NotElementary("a power whose exponent is computed")
    return _through(
        RIGOROUS.real_power(a.value, n), RIGOROUS.scale(n, RIGOROUS.real_power(a.value, n - 1)), a
    )


def _sine(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    return _through(RIGOROUS.cosine(a.value, 0.5), RIGOROUS.cosine(a.value, 0.0), a)


def _cos(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    return _through(RIGOROUS.cosine(a.value, 0.0), negative(RIGOROUS.cosine(a.value, 0.5)), a)


def _exp(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    value = RIGOROUS.rising(np.exp, a.value)
    return _through(value, value, a)


def _log(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    return _through(RIGOROUS.rising(np.log, a.value), RIGOROUS.inverse(a.value), a)


def _tanh(node: Node, bound: Bound) -> Dual:
    a = bound(node.args[0])
    value = RIGOROUS.rising(np.tanh, a.value)
    slope = RIGOROUS.add(point(np.ones_like(value.low)), negative(RIGOROUS.whole_power(value, 2)))
    return _through(value, slope, a)


def _equal(node: Node, bound: Bound) -> Dual:
    holds = RIGOROUS.equal(*(bound(x).value for x in node.args))
    return Dual(holds if node.op == "eq" else RIGOROUS.opposite(holds), bound(0.0).slope)


def _logic(node: Node, bound: Bound) -> Dual:
    rule = {"not": RIGOROUS.opposite, "and": RIGOROUS.both, "or": RIGOROUS.either}[node.op]
    return Dual(rule(*(bound(x).value for x in node.args)), bound(0.0).slope)


def _select(node: Node, bound: Bound) -> Dual:
    which, no, yes = map(bound, node.args)
    low, high = RIGOROUS.choose(which.value, no.slope, yes.slope)
    # Where the choice may change within a box, the number may jump: no derivative exists.
    may_jump = (which.value.high > 0) & (which.value.low < 1)
    slope = Interval(np.where(may_jump, -np.inf, low), np.where(may_jump, np.inf, high))
    return Dual(RIGOROUS.choose(which.value, no.value, yes.value), slope)


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
