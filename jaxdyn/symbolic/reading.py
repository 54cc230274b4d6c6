"""Quantities of a scene as expressions, read from the programs that compute them."""

import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from jaxdyn import _checks
from jaxdyn.scene import Scene
from jaxdyn.solvers.formulas.formulas import objects, topological_order, trace
from jaxdyn.solvers.formulas.graph import COMPARISONS, Graph, Node, NotElementary, Number
from jaxdyn.symbolic.algebra import (
    Call,
    Expression,
    Symbol,
    as_expression,
    factors_in,
    function,
    number,
)
from jaxdyn.symbolic.parameters import rebuild
from jaxdyn.symbolic.simplifying import simplify
from jaxdyn.symbolic.symbols import Symbols
from jaxdyn.symbolic.trigonometry import shorten_deeply

#: Largest number of operations of a program that is read; longer equations would be unreadable.
_MOST_NODES = 20_000
#: Functions that are constant in regions.
_STEPPED = frozenset({"ceil", "floor", "max", "min", "round", "select", "sign", "step"})


def read(scene: Scene, of: Symbols, quantity: Callable[..., Any], *more: list) -> list[np.ndarray]:
    """A quantity of a scene as expressions.

    Isolated points at which another formula holds, such as the direction of a spring of length 0,
    are ignored.

    Args:
      scene: only its structure is used.
      of: its symbols.
      quantity: a function of (field, t, y), and of arrays of further symbols; returns arrays.
      more: lists of the further symbols.
    Returns:
      The leaves of the quantity, arrays of expressions.
    Raises:
      ValueError: it contains something without formulas.
    """
    graph = Graph(expanding=False, smooth=False, most=_MOST_NODES, written=True)
    meant: dict[Node, Expression] = {}

    def given(x: Symbol | Expression, moving: bool) -> Number:
        x = as_expression(x)
        if x.is_number:
            return float(x.number)
        node = graph.input(None, moving=moving)
        meant[node] = x
        return node

    def row(symbols, moving: bool) -> np.ndarray:
        return objects([given(s, moving) for s in symbols], (len(symbols),))

    def function_of(t, y, values, *rest):
        return quantity(rebuild(scene.field, values), t, y, *rest)

    inputs = [row([of.time], True).reshape(()), row(of.state, True), row(of.parameters, False)]
    inputs += [row(symbols, True) for symbols in more]
    try:
        found = trace(graph, function_of, *inputs)
    except NotElementary as error:
        raise _checks.fail(
            "equations",
            "a scene whose rate has formulas",
            str(error),
            "Loops of unknown length, callbacks and solvers of the user have none.",
        ) from error
    nodes = topological_order(graph, [x for array in found for x in np.ravel(array).tolist()])
    for node in nodes:
        if node not in meant:
            meant[node] = _expression(node, meant, of.values)
    results = []
    for array in found:
        flat = [_meaning(x, meant) for x in np.ravel(array).tolist()]
        results.append(objects([simplify(x) for x in flat], np.shape(array)))
    return results


def _meaning(a: Number, meant: dict[Node, Expression]) -> Expression:
    return meant[a] if isinstance(a, Node) else number(float(a))


def _expression(
    node: Node, meant: dict[Node, Expression], values: Mapping[Symbol, float]
) -> Expression:
    op = node.op
    if op == "sum":
        found = number(0)
        for factor, term in zip(node.args[::2], node.args[1::2], strict=True):
            part = _meaning(factor, meant)
            found = found + (part if term is None else part * _meaning(term, meant))
        return found
    args = [_meaning(a, meant) for a in node.args]
    if op in ("scale", "mul", "product"):
        return math.prod(args[1:], start=args[0])
    if op == "add":
        return args[0] + args[1]
    if op == "div":
        return args[0] / args[1]
    if op == "sqrt":
        return shorten_deeply(args[0]) ** Fraction(1, 2)
    if op == "pow":
        exponent = args[1]
        if exponent.is_number and isinstance(exponent.number, Fraction):
            return shorten_deeply(args[0]) ** exponent.number
        return function("pow", *args)
    if op == "select":
        return _select(node.args[0], meant, values, *args[1:])
    if op == "real":
        return _select(node.args[0], meant, values, number(0), number(1))
    if op in ("eq", "ne"):
        condition, opposite = _condition_in(node)
        if condition is not node:
            found = _meaning(condition, meant)
            return function("not", found) if opposite else found
    return function(op, *args)


def _condition_in(condition: Number) -> tuple[Number, bool]:
    """The condition whose value, 1 or 0, is compared, and whether the condition must be false.

    Rates that are written as text compare in this way: ``if(x > 1)then(...)`` tests whether the
    value of x > 1 is not 0.
    """
    opposite = False
    while isinstance(condition, Node) and condition.op in ("eq", "ne"):
        a, b = condition.args
        if isinstance(b, Node):
            a, b = b, a
        if isinstance(b, Node) or not isinstance(a, Node) or a.op not in ("real", "select"):
            break
        inner, no, yes = (a.args[0], 0.0, 1.0) if a.op == "real" else a.args
        if isinstance(no, Node) or isinstance(yes, Node) or (no == b) == (yes == b):
            break
        opposite ^= (yes == b) != (condition.op == "eq")
        condition = inner
    return condition, opposite


def _select(
    condition: Number,
    meant: dict[Node, Expression],
    values: Mapping[Symbol, float],
    no: Expression,
    yes: Expression,
) -> Expression:
    condition, opposite = _condition_in(condition)
    if opposite:
        no, yes = yes, no
    which = _meaning(condition, meant)
    op = condition.op if isinstance(condition, Node) else ""
    if op in ("eq", "ne") and which.symbols() <= values.keys():
        # A law of its own for one value of a parameter: log r, where r^(n + 1) / (n + 1) has none.
        return yes if which.value(values) else no
    if op in ("eq", "ne") and _has_steps(which):  # true, or false, in whole regions
        return function("select", which, yes, no)
    if op == "eq" or _is_nan(yes):  # true at isolated points only, or nowhere
        return no
    if op == "ne" or _is_nan(no):
        return yes
    if op in COMPARISONS and no == number(0) and yes.is_number and yes:
        ((call, _),) = next(iter(which.terms))
        a, b = call.args
        return yes * function("step", a - b if op in ("gt", "ge") else b - a)
    return function("select", which, yes, no)


def _has_steps(x: Expression) -> bool:
    """Whether there is a function in it that can be constant in regions."""
    return any(isinstance(a, Call) and a.op in _STEPPED for a, _ in factors_in(x))


def _is_nan(x: Expression) -> bool:
    return x.is_number and isinstance(x.number, float) and math.isnan(x.number)
