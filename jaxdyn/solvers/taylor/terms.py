"""The terms of the Taylor series of a solution, and what a step takes from them."""

import functools
from collections.abc import Callable, Iterator

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from jaxdyn._numerics import rough_power, runtime_one
from jaxdyn.solvers.formulas.formulas import Formulas
from jaxdyn.solvers.formulas.graph import (
    Node,
    Number,
    constant,
    minus,
    plus,
    select,
    times,
    value,
    weighted_sum,
)
from jaxdyn.solvers.formulas.graph import Value as Coefficient
from jaxdyn.solvers.method import STEP_SAFETY

# ---- Terms of the Taylor series of a solution, one order after the other
#
# If w = u v, the coefficients of the product are w_k = sum_j u_j v_(k-j); every elementary function
# satisfies a differential equation with such products in it, which gives its recurrence (Jorba, Zou
# 2005, Experimental Mathematics 14, 99; Griewank, Walther, Evaluating Derivatives, 13). So n
# products cost n N^2 / 2 multiplications for N orders, however deeply they are nested. Time is in
# units of the step, so that coefficients are terms already: no powers of the step are needed.
#
# Everything is unrolled into scalars: a loop over orders would be shorter, but each round is a
# handful of operations, and launching them takes ten times as long as doing them (measured).
# Divisions are by numbers of order zero only, as products with their inverses: XLA computes a
# division once and keeps it, while it would recompute other shared results for each use, unless all
# of it ends in one array (see `method`).


def solution(
    formulas: Formulas, nodes: list[Node], order: int, h: Array
) -> list[list[Coefficient]]:
    """The terms of the solution through the given state, over one step.

    Args:
      formulas: the formulas of the rate.
      nodes: the required nodes, in order (`formulas.topological_order`).
      order: number of terms of each entry besides the first.
      h: () the step.
    """
    series = _Series(order, h)
    series.coefficients[formulas.time] = [formulas.time.value, h]
    for node in formulas.states:
        series.coefficients[node] = [node.value]
    for node in nodes:
        series.coefficients[node] = [value(node, lambda a: series.at(a, 0))]
    for k in range(order):
        for node in nodes:
            if k and node.moving:
                series.coefficients[node].append(_RULES[node.op](series, node, k))
        for node, rate in zip(formulas.states, formulas.rates, strict=True):
            series.coefficients[node].append(times(series.step(k + 1), series.at(rate, k)))
    return [series.coefficients[node] for node in formulas.states]


class _Series:
    """The coefficients found so far, and what is computed from them once.

    Attributes:
      coefficients: the coefficients of each node, lowest order first.
    """

    def __init__(self, order: int, h: Array):
        # The numbers are in arrays: from (2 a) (3 b) the compiler makes 6 (a b), one more product
        # for each use of 2 a as a factor (measured: 1.6 times as many for a rigid body).
        inverses = 1.0 / np.arange(1, order + 1)
        self._parts = jnp.unstack(inverses * runtime_one(h))
        self._steps = jnp.unstack(inverses * h)
        self.coefficients: dict[Node, list[Coefficient]] = {}
        self._slopes: dict[tuple[Number, int], Coefficient] = {}
        self._inverses: dict[Number, Coefficient] = {}

    def at(self, a: Number, k: int) -> Coefficient:
        """Coefficient k of a node or of a known number."""
        if not isinstance(a, Node):
            return constant(a) if k == 0 else None
        found = self.coefficients[a]
        return found[k] if k < len(found) else None

    def part(self, k: int) -> Coefficient:
        """The number 1 / k."""
        return self._parts[k - 1]

    def step(self, k: int) -> Coefficient:
        """The number h / k."""
        return self._steps[k - 1]

    def slope(self, a: Number, k: int) -> Coefficient:
        """The number k a_k, which is coefficient k - 1 of the derivative."""
        if (a, k) not in self._slopes:
            self._slopes[a, k] = times(np.float64(k), self.at(a, k))
        return self._slopes[a, k]

    def inverse(self, a: Number) -> Coefficient:
        """The number 1 / a_0."""
        if a not in self._inverses:
            self._inverses[a] = lax.div(np.float64(1.0), self.at(a, 0))
        return self._inverses[a]

    def product(self, a: Number, b: Number, k: int, first: int, last: int) -> Coefficient:
        """The sum of a_j b_(k-j) for j from first to last."""
        return self._total(self.at, a, b, k, range(first, last + 1))

    def slope_product(self, a: Number, b: Number, k: int, last: int) -> Coefficient:
        """The sum of j a_j b_(k-j) for j from 1 to last."""
        return self._total(self.slope, a, b, k, range(1, last + 1))

    def _total(self, of: Callable, a: Number, b: Number, k: int, places: range) -> Coefficient:
        # Known terms come first. A product and its sum are one operation of the processor,
        # unlike in a pairwise sum.
        known = sorted(places, key=lambda j: max(j, k - j))
        products = (times(of(a, j), self.at(b, k - j)) for j in known)
        return functools.reduce(plus, products, None)

    def square(self, a: Number, k: int, first: int) -> Coefficient:
        """The sum of a_j a_(k-j) for j from first to k - first, each pair once."""
        twice = times(np.float64(2.0), self.product(a, a, k, first, (k - 1) // 2))
        middle = None if k % 2 or k < 2 * first else self.at(a, k // 2)
        return plus(twice, times(middle, middle))


def _sum(s: _Series, node: Node, k: int) -> Coefficient:
    parts = zip(node.args[::2], node.args[1::2], strict=True)
    return weighted_sum([(s.at(c, 0), s.at(m, k)) for c, m in parts if m is not None])


def _scale(s: _Series, node: Node, k: int) -> Coefficient:
    return times(s.at(node.args[0], 0), s.at(node.args[1], k))


def _product(s: _Series, node: Node, k: int) -> Coefficient:
    a, b = node.args
    return s.square(a, k, 0) if a is b else s.product(a, b, k, 0, k)


def _div(s: _Series, node: Node, k: int) -> Coefficient:
    a, b = node.args
    return times(minus(s.at(a, k), s.product(node, b, k, 0, k - 1)), s.inverse(b))


def _sqrt(s: _Series, node: Node, k: int) -> Coefficient:
    (a,) = node.args
    half = times(np.float64(0.5), s.inverse(node))
    return times(minus(s.at(a, k), s.square(node, k, 1)), half)


def _pow(s: _Series, node: Node, k: int) -> Coefficient:
    # a w' = n a' w, for any n.
    a, n = node.args
    grown = times(lax.add(s.at(n, 0), np.float64(1.0)), s.slope_product(a, node, k, k))
    return times(minus(times(s.part(k), grown), s.product(a, node, k, 1, k)), s.inverse(a))


def _log(s: _Series, node: Node, k: int) -> Coefficient:
    (a,) = node.args
    known = times(s.part(k), s.slope_product(node, a, k, k - 1))
    return times(minus(s.at(a, k), known), s.inverse(a))


def _exponential_rule(factor: Callable[[Node], Node], sign: float = 1.0) -> Callable:
    """Rule of a function whose derivative is another node: w' = a' times that node."""

    def rule(s: _Series, node: Node, k: int) -> Coefficient:
        (a,) = node.args
        return times(s.part(k), times(np.float64(sign), s.slope_product(a, factor(node), k, k)))

    return rule


def _partner(node: Node) -> Node:
    assert node.partner is not None
    return node.partner


def _select(s: _Series, node: Node, k: int) -> Coefficient:
    which, no, yes = node.args
    return select(s.at(which, 0), s.at(no, k), s.at(yes, k))


_RULES: dict[str, Callable[[_Series, Node, int], Coefficient]] = {
    **{"sum": _sum, "scale": _scale, "product": _product, "div": _div},
    **{"sqrt": _sqrt, "pow": _pow, "log": _log, "select": _select},
    "exp": _exponential_rule(lambda node: node),
    "sin": _exponential_rule(_partner),
    "cos": _exponential_rule(_partner, -1.0),
    "tanh": _exponential_rule(_partner),
}


# ---- What a step takes from the terms of its series: the sum, the error, how far it may go
#
# The terms are those of a proposed step. For a part z of it the term of order k is z^k times as
# large, so how far the step may go is known before it is taken. A pair only learns from the error
# of a step how long the next one may be, and by then the motion has changed: with its rule series
# took 10 to 30 % more steps for the same error (a spherical pendulum, a rigid body, Kepler's
# orbit), and up to 5 % of them were rejected.

#: The estimate of the error in multiples of the last term. The error of a step is about the next
#: term, which is a few times smaller. But whoever asks for a tolerance by habit should not lose
#: digits: with this factor, errors of whole motions at one tolerance are no larger than those of a
#: pair in nine of ten runs (27 problems, tolerances of 1e-4 to 1e-13), and a sixteenth of them in
#: the median. At equal errors it costs nothing.
_CAUTION = 3.0
#: Weight of the difference of slopes at the end of a step, which also shows jumps within it: that
#: difference is already the next term, times the order.
_DEFECT_WEIGHT = 2.0
#: The part of it below this many roundings of the slope may be rounding, and gets this weight. The
#: weight is not zero, or steps would grow until they are rejected.
_SLOPE_ROUNDINGS, _ROUNDING_WEIGHT = 8.0, 0.25
#: Weight of the last term but one, in case the last one vanishes by symmetry. Successive terms
#: decrease by about this factor at the steps that tolerances lead to.
_LAST_BUT_ONE_WEIGHT = 0.1
#: Weight of each earlier term, in case both vanish: less than the ratio of terms, or these would
#: limit the steps of motions without such a symmetry (0.05 does, at rtol 1e-14).
_TERM_RATIO = 0.03


def increment(c: list[Coefficient], part: Array) -> Array:
    """The sum of all terms but the first at a part of the step.

    It is Horner's rule for every second term: one chain of all terms would take as long as the
    terms of a short formula, since nothing else is left to compute meanwhile.
    """
    square = part * part
    odd, even = (_polynomial(c[first::2], square) for first in (1, 2))
    found = [x for x in (times(odd, part), times(even, square)) if x is not None]
    return functools.reduce(jnp.add, found, jnp.zeros_like(part))


def _polynomial(c: list[Coefficient], z: Array) -> Coefficient:
    found = None
    for term in reversed(c):
        found = plus(term, times(found, z))
    return found


def slope(c: list[Coefficient], part: Array) -> Array:
    """The slope at a part of the step, times that part of the step."""
    return increment([None if x is None else np.float64(k) * x for k, x in enumerate(c)], part)


def last(c: list[Coefficient], part: Array) -> Array:
    """The last term at a part of the step. For all entries it is a direction of the error."""
    return _or_zero(times(c[-1], lax.integer_pow(part, len(c) - 1)))


def error(c: list[Coefficient], part: Array) -> Array:
    """The error at a part of the step: the sizes of terms that show it, with the last's sign."""
    shown = ((weight, times(c[k], lax.integer_pow(part, k))) for k, weight in _weights(len(c) - 1))
    sizes = (times(weight, jnp.abs(term)) for weight, term in shown if term is not None)
    found = _or_zero(functools.reduce(plus, sizes, None))
    return jnp.where(_or_zero(c[-1]) < 0, -found, found)


def squares(series: list[list[Coefficient]], inverses: list[Array]) -> dict[int, Coefficient]:
    """Squares of the terms that show the error, in tolerances, by order: means over all entries.

    Args:
      series: the terms of each entry.
      inverses: inverses of the error that each entry may have.
    """
    found = {}
    for k, weight in _weights(len(series[0]) - 1):
        scaled = (times(c[k], x) for c, x in zip(series, inverses, strict=True))
        total = functools.reduce(plus, (times(x, x) for x in scaled), None)
        found[k] = times(np.float64(weight * weight / len(series)), total)
    return found


def square_error(squares: dict[int, Coefficient], part: Array) -> Array:
    """() the square of the error of a part of the step, in tolerances."""
    z = part * part
    found = _polynomial([squares[k] for k in sorted(squares)], z)
    return _or_zero(times(found, lax.integer_pow(z, min(squares))))


def reach(squares: dict[int, Coefficient]) -> Array:
    """() the part of the step, or multiple of it, with an error well within the tolerance.

    It is found as if the error were proportional to the power of the part in the last term.
    """
    total = _or_zero(functools.reduce(plus, squares.values(), None))
    return STEP_SAFETY * rough_power(total, -0.5 / max(squares))


def _weights(order: int) -> Iterator[tuple[int, np.float64]]:
    """The orders of the terms that show the error, and the weight of each.

    They are the last two and, in case these vanish by symmetry, earlier ones: terms of the second
    half count, since x'' = -x^7 from x = 0 has only every eighth one.
    """
    for k in range(order // 2 + 1, order + 1):
        before = order - 1 - k
        weight = 1.0 if before < 0 else _LAST_BUT_ONE_WEIGHT * _TERM_RATIO**before
        yield k, np.float64(_CAUTION * weight)


def _or_zero(x: Coefficient) -> Array:
    return jnp.zeros(()) if x is None else jnp.asarray(x)


def error_of_slopes(found: Array, expected: Array) -> Array:
    """The error from the difference of slopes, both times the step, with its signs."""
    apart, rounding = (
        found - expected,
        _SLOPE_ROUNDINGS * jnp.finfo(found.dtype).eps * jnp.abs(found),
    )
    small = jnp.clip(apart, -rounding, rounding)
    return _DEFECT_WEIGHT * (apart - small) + _ROUNDING_WEIGHT * small


def snap_to_number(reach: Array, t: Array, h: Array, inverse: Array) -> Array:
    """The part of a step from t, up to its reach, whose end is a floating-point number.

    Otherwise the state would belong to another time than the one noted, and the differences of the
    times of many steps, half a spacing each, would not be compensated.

    Args:
      reach: () how far the step may go, in parts of it.
      t: () start of the step.
      h: () the step, of either sign.
      inverse: 1 / h.
    """
    return jnp.where(reach < 1.0, ((t + reach * h) - t) * inverse, 1.0)
