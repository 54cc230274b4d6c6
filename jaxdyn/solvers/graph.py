"""Scalar formulas as a graph: each different number of a calculation once, in normal form.

Numbers known when the program is compiled are Python numbers; others are nodes. What does not
change within a step (masses, lengths) is told from what moves: products have their steady factors
in front, sums collect equal terms. So the cosine and sine of one angle, or the same product of
velocities under two different masses, are one node, however the rate was written.
"""

import functools
import operator
from collections.abc import Callable

import numpy as np
from jaxtyping import Array


class Node:
    """A number of the calculation.

    Attributes:
      index: which one it is, in the order of making.
      op: "input" for what is integrated, "given" for what is known at run time, or an operation.
      args: what it is applied to: nodes and known numbers; of a sum, factors and terms in turn.
      moving: whether it changes within a step. Comparisons do not: they hold for a whole step.
      value: () the number itself, where it is given.
      partner: the node whose series this one's needs: of a sine the cosine.
    """

    __slots__ = ("args", "index", "moving", "op", "partner", "value")

    def __init__(self, index: int, op: str, args: tuple, moving: bool, value: Array | None = None):
        self.index, self.op, self.args = index, op, args
        self.moving, self.value = moving, value
        self.partner: Node | None = None


#: A node, or a number known when the program is compiled.
Number = Node | float | int | bool

COMPARISONS = {
    **{"lt": operator.lt, "le": operator.le, "gt": operator.gt, "ge": operator.ge},
    **{"eq": operator.eq, "ne": operator.ne},
}
LOGIC = {"and": operator.and_, "or": operator.or_, "not": operator.not_}
#: Operations with a result that holds for a whole step.
STEADY = frozenset({*COMPARISONS, *LOGIC})
FUNCTIONS = {
    **{"sin": np.sin, "cos": np.cos, "exp": np.exp, "log": np.log, "sqrt": np.sqrt},
    **{"tanh": np.tanh},
}
#: Terms up to which sums are merged to find equal ones; longer ones stay as they are.
_LONGEST_SUM = 8
_WRITTEN_OUT = 8  # powers up to which they are products


class Graph:
    """Nodes in the order in which they can be computed.

    A product with a known 0 is 0, whatever the other factor: an infinity there is lost.
    """

    def __init__(self):
        self.nodes: list[Node] = []
        self._found: dict[tuple, Node] = {}

    def given(self, value: Array, moving: bool = False) -> Node:
        """A number known at run time only."""
        return self._new("input" if moving else "given", (), moving, value)

    def node(self, op: str, *args: Number | None) -> Node:
        """op(*args), the node there is already if there is one."""
        key = op, *((a.index, Node) if isinstance(a, Node) else (a, type(a)) for a in args)
        if key not in self._found:
            moving = op not in STEADY and any(isinstance(a, Node) and a.moving for a in args)
            self._found[key] = self._new(op, args, moving)
        return self._found[key]

    def _new(self, op: str, args: tuple, moving: bool, value: Array | None = None) -> Node:
        self.nodes.append(Node(len(self.nodes), op, args, moving, value))
        return self.nodes[-1]

    def add(self, a: Number, b: Number) -> Number:
        """A sum; equal terms are collected."""
        terms = _terms(a)
        for m, c in _terms(b).items():
            terms[m] = self._steady("add", terms.get(m, 0.0), c)
        if len(terms) > _LONGEST_SUM and isinstance(a, Node) and isinstance(b, Node):
            terms = {a: 1.0, b: 1.0}
        left = [(c, m) for m, c in terms.items() if not _is(c, 0)]
        if len(left) < 2:
            return self._scaled(*(left[0] if left else (0.0, None)))
        return self.node("sum", *(x for term in left for x in term))

    def neg(self, a: Number) -> Number:
        """Minus a number."""
        return self.mul(-1.0, a)

    def sub(self, a: Number, b: Number) -> Number:
        """A difference."""
        return self.add(a, self.neg(b))

    def mul(self, a: Number, b: Number) -> Number:
        """A product, steady factors in front."""
        (c, m), (d, n) = _parts(a), _parts(b)
        c = self._steady("mul", c, d)
        if m is None or n is None:
            return self._scaled(c, n if m is None else m)
        if m is n:
            return self._scaled(c, self.node("square", m))
        # In an order that is the same in each process, or the compile cache would not know it.
        first, second = (m, n) if m.index < n.index else (n, m)
        return self._scaled(c, self.node("mul", first, second))

    def div(self, a: Number, b: Number) -> Number:
        """A quotient, steady factors in front."""
        (c, m), (d, n) = _parts(a), _parts(b)
        c = self._steady("div", c, d)
        if n is None:
            return self._scaled(c, m)
        return self._scaled(c, self.node("div", 1.0 if m is None else m, n))

    def power(self, a: Number, n: Number) -> Number:
        """a to the power of n, which does not move."""
        if isinstance(n, Node):
            return self.node("pow", a, n)
        if not isinstance(a, Node):
            return float(np.float64(a) ** n)
        if n == int(n) and abs(n) <= _WRITTEN_OUT:
            product = functools.reduce(self.mul, [a] * abs(int(n)), 1.0)
            return product if n >= 0 else self.div(1.0, product)
        return self.function("sqrt", a) if n == 0.5 else self.node("pow", a, float(n))

    def function(self, op: str, a: Number) -> Number:
        """An elementary function."""
        if not isinstance(a, Node):
            return float(FUNCTIONS[op](a))
        if op in ("sin", "cos"):
            sine, cosine = self.node("sin", a), self.node("cos", a)
            sine.partner, cosine.partner = cosine, sine
            return sine if op == "sin" else cosine
        node = self.node(op, a)
        if op == "tanh" and node.partner is None:
            slope = self.sub(1.0, self.mul(node, node))
            assert isinstance(slope, Node)
            node.partner = slope
        return node

    def compare(self, op: str, *args: Number) -> Number:
        """A comparison, or a logical operation on some."""
        if any(isinstance(a, Node) for a in args):
            return self.node(op, *args)
        return (COMPARISONS | LOGIC)[op](*args)

    def select(self, which: Number, no: Number, yes: Number) -> Number:
        """One of two, by a condition."""
        if not isinstance(which, Node):
            return yes if which else no
        return no if no is yes else self.node("select", which, no, yes)

    def _scaled(self, c: Number, m: Node | None) -> Number:
        if m is None or _is(c, 0):
            return c
        return m if _is(c, 1) else self.node("scale", c, m)

    def _steady(self, op: str, a: Number, b: Number) -> Number:
        """A sum, product or quotient of what does not move."""
        if not isinstance(a, Node) and not isinstance(b, Node):
            with np.errstate(all="ignore"):
                return float(_ARITHMETIC[op](np.float64(a), np.float64(b)))
        if op == "add":
            return b if _is(a, 0) else a if _is(b, 0) else self.node(op, a, b)
        if _is(a, 0) or (op == "mul" and _is(b, 0)):
            return 0.0
        if op == "mul" and _is(a, 1):
            return b
        return a if _is(b, 1) else self.node(op, a, b)


_ARITHMETIC: dict[str, Callable] = {"add": operator.add, "mul": operator.mul, "div": np.divide}


def _is(a: Number, x: int) -> bool:
    return not isinstance(a, Node) and a == x


def _parts(a: Number) -> tuple[Number, Node | None]:
    """A number as what is steady times what moves, if anything does."""
    if not isinstance(a, Node) or not a.moving:
        return a, None
    return (a.args[0], a.args[1]) if a.op == "scale" else (1.0, a)


def _terms(a: Number) -> dict[Node | None, Number]:
    """What moves in a sum and its steady factors; under None what does not move."""
    if isinstance(a, Node) and a.op == "sum":
        return dict(zip(a.args[1::2], a.args[::2], strict=True))
    c, m = _parts(a)
    return {m: c}
