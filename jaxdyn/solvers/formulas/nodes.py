"""The nodes of a graph of formulas, and what can be read off a single one."""

import math
import operator

import numpy as np
from jaxtyping import Array


class NotElementary(Exception):
    """Raised for a rate with an operation that cannot be represented here; names it."""


class Node:
    """A number of the calculation.

    Attributes:
      index: its number in order of creation.
      op: "input" for what is integrated, "given" for what is known at run time, or an operation.
      args: its operands: nodes and known numbers; of a sum, factors and terms in turn.
      moving: whether it changes within a step. Conditions count as steady: in a series they are,
        and in formulas that are only evaluated no value depends on it.
      value: () the number itself, where it is given.
      partner: the node whose series it needs: of a sine the cosine.
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
#: Conditions of one number.
TESTS = {"is_finite": math.isfinite}
#: Operations whose result is not a moving number; see `Node.moving`.
STEADY = frozenset({*COMPARISONS, *LOGIC, *TESTS, "real"})
#: Functions without a series here, by the names of JAX's primitives: they can only be evaluated.
ROUGH = frozenset({"abs", "max", "min", "sign", "floor", "ceil", "rem", "cbrt", "exp2"}) | {
    *("tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "asinh", "acosh", "atanh"),
    *("expm1", "log1p", "logistic", "erf"),
}
FUNCTIONS = {
    **{"sin": np.sin, "cos": np.cos, "exp": np.exp, "log": np.log, "sqrt": np.sqrt},
    **{"tanh": np.tanh},
}


def split(a: Number) -> tuple[Number, Node | None]:
    """A number as a steady factor times a moving node, if any."""
    if not isinstance(a, Node) or not a.moving:
        return a, None
    return (a.args[0], a.args[1]) if a.op == "scale" else (1.0, a)


def factors_of(m: Node) -> tuple:
    """The factors of a product, or the number itself."""
    return m.args if m.op == "product" else (m,)


def place(term: tuple[Number, Node | None]) -> float:
    """Of a term in a sum: as created, the steady part last."""
    _, m = term
    return math.inf if m is None else m.index


def broken_power(m: Node) -> tuple[Node, float] | None:
    """A number that is a power of another, and which, such as r^2 sqrt(r^2): 3/2 of r^2."""
    if m.op == "pow" and not isinstance(m.args[1], Node):
        return m.args
    roots = [x for x in factors_of(m) if x.op == "sqrt"]
    if len(roots) % 2 == 0 or not all(x in (roots[0], roots[0].args[0]) for x in factors_of(m)):
        return None
    return roots[0].args[0], len(factors_of(m)) - 0.5 * len(roots)
