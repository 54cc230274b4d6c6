"""Scalar formulas as a graph: each distinct number of a calculation once, in normal form.

Numbers known when the program is compiled are Python numbers; others are nodes. Numbers that are
constant within a step (masses, lengths) are distinguished from moving ones. A product is a steady
factor in front of a list of moving ones, a sum collects equal products, and a - b and b - a differ
by a factor of -1 where they are multiplied, divided by, or the argument of a function. So the same
product of velocities, sines and cosines is one node, however the rate was written, and terms that
cancel vanish. `formulas.topological_order` splits products into products of two factors again,
and shares those.
"""

import functools
import math
import operator
from collections.abc import Callable
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array


class NotElementary(Exception):
    """Raised for a rate with an operation that cannot be represented here; names it."""


class Node:
    """A number of the calculation.

    Attributes:
      index: its number in order of creation.
      op: "input" for what is integrated, "given" for what is known at run time, or an operation.
      args: its operands: nodes and known numbers; for a sum, alternately factors and terms.
      moving: whether it changes within a step. Conditions count as steady: in a series they are,
        and in formulas that are only evaluated no value depends on it.
      value: () the number itself, where it is given.
      partner: the node whose series it needs, such as the cosine for a sine.
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


def split_factor(a: Number) -> tuple[Number, Node | None]:
    """A number as a steady factor times a moving node, if any."""
    if not isinstance(a, Node) or not a.moving:
        return a, None
    return (a.args[0], a.args[1]) if a.op == "scale" else (1.0, a)


def factors_of(m: Node) -> tuple:
    """The factors of a product; of another number, the number itself."""
    return m.args if m.op == "product" else (m,)


def place(term: tuple[Number, Node | None]) -> float:
    """The position of a term in a sum: in order of creation, with the steady part last."""
    _, m = term
    return math.inf if m is None else m.index


def broken_power(m: Node) -> tuple[Node, float] | None:
    """The base and the exponent of a number that is a power: r^2 and 3/2 for r^2 sqrt(r^2)."""
    if m.op == "pow" and not isinstance(m.args[1], Node):
        return m.args
    roots = [x for x in factors_of(m) if x.op == "sqrt"]
    if len(roots) % 2 == 0 or not all(x in (roots[0], roots[0].args[0]) for x in factors_of(m)):
        return None
    return roots[0].args[0], len(factors_of(m)) - 0.5 * len(roots)


#: Number of terms up to which sums are merged to find equal ones; longer sums stay as they are.
_LONGEST_SUM = 8
_MULTIPLIED_OUT = 3  # number of terms up to which products of sums are expanded
_MOST_FACTORS = 32  # largest power that is written as a product, which is smooth at 0


class Graph:
    """The nodes of a calculation, and arithmetic with them.

    A product with a known 0 is 0, whatever the other factor: an infinity there is lost.

    Args:
      exact: whether operations on known numbers are carried out only where the result is exactly
        a float; otherwise they are nodes, for another arithmetic to evaluate.
      expanding: whether products with short sums are multiplied out. Mostly that saves products,
        which exist already, or cancels terms; it does not where a sum is a factor of several.
      smooth: whether all of it must have a Taylor series, valid for a step. Otherwise the formulas
        can only be evaluated: conditions may change at any time, and any function may occur.
      most: number of nodes above which it is given up, with `NotElementary`.
      written: whether they are for a text. `jnp.interp` then becomes a choice among its pieces,
        with as many comparisons as the table has knots, where a compiled program searches.

    Attributes:
      expanded: whether any product was multiplied out.
    """

    def __init__(
        self,
        exact: bool = False,
        expanding: bool = True,
        smooth: bool = True,
        most: float = math.inf,
        written: bool = False,
    ):
        self.written, self._kept = written, set[Node]()
        self.exact, self.expanding, self.expanded = exact, expanding, False
        self.smooth, self.most = smooth, most
        self._found: dict[tuple, Node] = {}
        self._count = 0

    @property
    def count(self) -> int:
        """Number of nodes."""
        return self._count

    def input(self, value: Array, moving: bool = False) -> Node:
        """A number known only at run time."""
        return self._new("input" if moving else "given", (), moving, value)

    def node(self, op: str, *args: Number | None) -> Node:
        """The node op(*args), the existing one if there is one."""
        key = op, *map(_key, args)
        if key not in self._found:
            moving = op not in STEADY and any(isinstance(a, Node) and a.moving for a in args)
            self._found[key] = self._new(op, args, moving)
        return self._found[key]

    def _new(self, op: str, args: tuple, moving: bool, value: Array | None = None) -> Node:
        self._count += 1
        if self._count > self.most:
            raise NotElementary(f"more than {self.most} numbers")
        return Node(index=self._count, op=op, args=args, moving=moving, value=value)

    def add(self, a: Number, b: Number) -> Number:
        """A sum, with equal terms collected."""
        if a is b and isinstance(a, Node):
            return self.mul(2.0, a)
        terms = self._terms(a)
        for m, c in self._terms(b).items():
            terms[m] = self._steady("add", terms.get(m, 0.0), c)
        if len(terms) > _LONGEST_SUM and isinstance(a, Node) and isinstance(b, Node):
            terms = {a: 1.0, b: 1.0}
        self._unite_squares(terms)
        left = [(c, m) for m, c in terms.items() if not _is(c, 0)]
        if len(left) < 2:
            return self._scale(*(left[0] if left else (0.0, None)))
        return self.node("sum", *(x for term in left for x in term))

    def _terms(self, a: Number) -> dict[Node | None, Number]:
        """The moving terms of a sum with their steady factors; the steady part is under None."""
        c, m = split_factor(a)
        if m is None or m.op != "sum" or m in self._kept:
            return {m: c}
        parts = zip(m.args[::2], m.args[1::2], strict=True)
        return {term: self._steady("mul", c, factor) for factor, term in parts}

    def keep(self, a: Number) -> None:
        """Never take this sum apart in other sums: a small difference that has a large factor."""
        _, m = split_factor(a)
        if m is not None:
            self._kept.add(m)

    def _unite_squares(self, terms: dict[Node | None, Number]) -> None:
        """Replace cos^2 + sin^2 by 1, where both have the same factor."""
        for m in list(terms):
            if m is not None and m.op == "product" and len(m.args) == 2 and m.args[0].op == "sin":
                sine, other = m.args
                cosine = self.node("product", sine.partner, sine.partner)
                if sine is other and cosine in terms and terms[cosine] == terms[m]:
                    c = terms.pop(m)
                    del terms[cosine]
                    terms[None] = self._steady("add", terms.get(None, 0.0), c)

    def neg(self, a: Number) -> Number:
        """Minus a number."""
        return self.mul(-1.0, a)

    def sub(self, a: Number, b: Number) -> Number:
        """A difference."""
        return self.add(a, self.neg(b))

    def mul(self, a: Number, b: Number) -> Number:
        """A product, with steady factors in front."""
        (c, m), (d, n) = split_factor(a), split_factor(b)
        c = self._steady("mul", c, d)
        if m is None or n is None:
            return self._scale(c, n if m is None else m)
        (e, m), (f, n) = self._sign_and_rest(m), self._sign_and_rest(n)
        c = self._steady("mul", e * f, c)
        for one, other in ((m, n), (n, m)):
            if self.expanding and _better_multiplied_out(one, other):
                self.expanded = True
                return self.mul(c, self._multiply_out(one, other))
        # The order is the same in each process, for the compile cache.
        factors = sorted((*factors_of(m), *factors_of(n)), key=lambda node: node.index)
        return self._scale(c, self.node("product", *factors))

    def _sign_and_rest(self, m: Node) -> tuple[float, Node]:
        """A sign and the rest of a factor; for a sum, the form that a - b and b - a share."""
        if m.op != "sum":
            return 1.0, m
        terms = sorted(zip(m.args[::2], m.args[1::2], strict=True), key=place)
        first = terms[0][0]
        sign = -1.0 if not isinstance(first, Node) and first < 0 else 1.0
        parts = ((self._steady("mul", sign, c), term) for c, term in terms)
        return sign, self.node("sum", *(x for part in parts for x in part))

    def _multiply_out(self, terms: Node, factor: Node) -> Number:
        parts = zip(terms.args[::2], terms.args[1::2], strict=True)
        return functools.reduce(self.add, (self.mul(self._scale(c, m), factor) for c, m in parts))

    def div(self, a: Number, b: Number) -> Number:
        """A quotient, with steady factors in front."""
        (c, m), (d, n) = split_factor(a), split_factor(b)
        c = self._steady("div", c, d)
        if n is None:
            return self._scale(c, m)
        sign, n = self._sign_and_rest(n)
        c = self._steady("mul", sign, c)
        power = broken_power(n)
        # As a quotient, a ball around a direction, r / |r|, is smaller.
        if power is not None and (not self.exact or (m is None and n.op == "product")):
            base, exponent = power
            return self.mul(self._scale(c, m), self.node("pow", base, -exponent))
        return self._scale(c, self.node("div", 1.0 if m is None else m, n))

    def power(self, a: Number, n: Number) -> Number:
        """The number a to the power of a steady n."""
        a = self._in_one_form(a)
        if isinstance(n, Node):
            return self.node("pow", a, n)
        if not isinstance(a, Node) and not self.exact:
            with np.errstate(all="ignore"):
                return float(np.float64(a) ** n)
        if float(n).is_integer() and abs(n) <= _MOST_FACTORS:
            product = functools.reduce(self.mul, [a] * abs(int(n)), 1.0)
            return product if n >= 0 else self.div(1.0, product)
        return self.function("sqrt", a) if n == 0.5 else self.node("pow", a, float(n))

    def function(self, op: str, a: Number) -> Number:
        """An elementary function."""
        if not isinstance(a, Node) and not self.exact:
            with np.errstate(all="ignore"):
                return float(FUNCTIONS[op](a))
        a = self._in_one_form(a)
        if op in ("sin", "cos"):
            c, m = split_factor(a)
            if m is not None and not isinstance(c, Node) and c < 0:
                found = self.function(op, self.neg(a))
                return self.neg(found) if op == "sin" else found
            sine, cosine = self.node("sin", a), self.node("cos", a)
            sine.partner, cosine.partner = cosine, sine
            return sine if op == "sin" else cosine
        node = self.node(op, a)
        if op == "tanh" and node.partner is None:
            slope = self.sub(1.0, self.mul(node, node))
            assert isinstance(slope, Node)
            node.partner = slope
        return node

    def _in_one_form(self, a: Number) -> Number:
        """The number, with sums in the form of `_sign_and_rest`."""
        c, m = split_factor(a)
        if m is None:
            return a
        sign, m = self._sign_and_rest(m)
        return self._scale(self._steady("mul", sign, c), m)

    def compare(self, op: str, *args: Number) -> Number:
        """A condition, or a logical operation on conditions."""
        if any(isinstance(a, Node) for a in args):
            return self.node(op, *args)
        return (COMPARISONS | LOGIC | TESTS)[op](*args)

    def select(self, which: Number, no: Number, yes: Number) -> Number:
        """One of two numbers, chosen by a condition."""
        if not isinstance(which, Node):
            return yes if which else no
        return no if no is yes else self.node("select", which, no, yes)

    def real(self, a: Number) -> Number:
        """A boolean or an integer as a real number."""
        return self.node("real", a) if isinstance(a, Node) else float(a)

    def _scale(self, c: Number, m: Node | None) -> Number:
        if m is None or _is(c, 0):
            return c
        return m if _is(c, 1) else self.node("scale", c, m)

    def _steady(self, op: str, a: Number, b: Number) -> Number:
        """A sum, product or quotient of steady numbers."""
        if not isinstance(a, Node) and not isinstance(b, Node):
            with np.errstate(all="ignore"):
                found = float(_ARITHMETIC[op](np.float64(a), np.float64(b)))
            if not self.exact or _is_exactly(found, op, a, b):
                return found
            return self.node(op, a, b)
        if op == "add":
            return b if _is(a, 0) else a if _is(b, 0) else self.node(op, a, b)
        if _is(a, 0) or (op == "mul" and _is(b, 0)):
            return 0.0
        if op == "mul" and _is(a, 1):
            return b
        return a if _is(b, 1) else self.node(op, a, b)


_ARITHMETIC: dict[str, Callable] = {
    **{"add": operator.add, "mul": operator.mul, "div": operator.truediv}
}


def _key(a: Number | None) -> tuple:
    """What distinguishes an operand from others: 0 and -0 differ, and so do 1 and True."""
    if isinstance(a, Node):
        return a.index, Node
    return a, type(a), isinstance(a, float) and math.copysign(1.0, a)


def _is(a: Number, x: int) -> bool:
    return not isinstance(a, Node) and a == x


def _is_exactly(found: float, op: str, a: float, b: float) -> bool:
    """Whether the result of an operation on known numbers is not rounded."""
    if not all(map(math.isfinite, (found, a, b))) or (op == "div" and b == 0):
        return False
    return _ARITHMETIC[op](Fraction(a), Fraction(b)) == found


def _better_multiplied_out(terms: Node, factor: Node) -> bool:
    """Whether expanded products are likely to exist already, or to cancel.

    They are as in sin a (sin a u^2 + sin b w^2) + cos a (...), the forces of hinged bars. Sums with
    single numbers never count: (x - 1)^2 is exact near x = 1, while x^2 - 2 x + 1 is all rounding.
    """
    if terms.op != "sum":
        return False
    moving = [m for m in terms.args[1::2] if m is not None]
    simple = factor.op in ("sin", "cos", "input") and all(m.op == "product" for m in moving)
    return simple and len(moving) <= _MULTIPLIED_OUT


# ---- The values of formulas: each operation as one of the compiler's

#: A value; a known number is a NumPy number, and a known zero is None.
Value = Array | np.floating | np.bool_ | None


def value(node: Node, at: Callable[[Number], Value]) -> Value:
    """The value of a node.

    Args:
      node: a node that is not an input.
      at: gives the values of its operands.
    """
    if node.op == "given":
        return node.value
    if node.op == "sum":
        return _sum(node, at)
    return _VALUES[node.op](*(at(a) for a in node.args))


def constant(a: float | int | bool) -> Value:
    """The value of a number known when the program is compiled."""
    return np.bool_(a) if isinstance(a, bool) else np.float64(a)


def times(a: Value, b: Value) -> Value:
    """A product; None for zero."""
    if a is None or b is None:
        return None
    if isinstance(a, np.floating) and abs(a) == 1.0:
        return b if a > 0 else lax.neg(b)
    return lax.mul(a, b)


def plus(a: Value, b: Value) -> Value:
    """A sum; None for zero."""
    if a is None or b is None:
        return b if a is None else a
    return lax.add(a, b)


def minus(a: Value, b: Value) -> Value:
    """A difference; None for zero."""
    if b is None:
        return a
    return lax.neg(b) if a is None else lax.sub(a, b)


def weighted_sum(terms: list[tuple[Value, Value]]) -> Value:
    """A sum of terms with their factors."""
    found = None
    for factor, term in terms:
        if isinstance(factor, np.floating) and factor == -1.0:
            found = minus(found, term)
        else:
            found = plus(found, times(factor, term))
    return found


def select(which: Value, no: Value, yes: Value) -> Array:
    """One of two values, chosen by a condition."""
    no, yes = (jnp.asarray(0.0 if x is None else x) for x in (no, yes))
    return lax.select(which, yes, no)


def _sum(node: Node, at: Callable[[Number], Value]) -> Value:
    parts = zip(node.args[::2], node.args[1::2], strict=True)
    return weighted_sum([(at(c), np.float64(1.0) if m is None else at(m)) for c, m in parts])


def _power(a: Value, n: Value) -> Array:
    a = jnp.asarray(a)
    if isinstance(n, np.floating) and n + 0.5 in (0.0, -1.0, -2.0, -3.0):
        # This is faster than the power, and more accurate.
        return lax.div(np.float64(1.0), lax.mul(lax.integer_pow(a, int(-n - 0.5)), lax.sqrt(a)))
    return lax.pow(a, jnp.asarray(n))


_VALUES: dict[str, Callable[..., Value]] = {
    **{"scale": times, "mul": times, "product": times, "add": plus, "div": lax.div},
    **{"sqrt": lax.sqrt, "exp": lax.exp, "log": lax.log, "pow": _power, "select": select},
    **{"sin": lax.sin, "cos": lax.cos, "tanh": lax.tanh},
    **{"lt": lax.lt, "le": lax.le, "gt": lax.gt, "ge": lax.ge, "eq": lax.eq, "ne": lax.ne},
    **{"and": lax.bitwise_and, "or": lax.bitwise_or, "not": lax.bitwise_not},
    "is_finite": lax.is_finite,
    "real": lambda a: lax.convert_element_type(a, float),
}
_VALUES |= {name: getattr(lax, name) for name in ROUGH}
assert set(_VALUES) >= STEADY
