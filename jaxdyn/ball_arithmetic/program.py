"""Formulas as a list of operations on balls: numbers, power series, complex discs.

Each operation is one function that reads its operands from numbered places: the formulas of a
rate are evaluated ten thousand times in a proof, and looking up an operation would take longer than
performing it.
"""

import dataclasses
import functools
import operator
from collections.abc import Callable
from typing import Any

import flint

from jaxdyn.ball_arithmetic.arithmetic import REAL, Functions, Undecided, arb, arb_series
from jaxdyn.solvers.formulas.formulas import topological_order
from jaxdyn.solvers.formulas.graph import COMPARISONS, LOGIC, TESTS, Graph, Node, Number

#: A function of the numbers at all places.
Operation = Callable[[list], Any]


@dataclasses.dataclass(eq=False)
class Program:
    """Formulas in an order of computation.

    Attributes:
      results: the nodes and known numbers that are computed.
      nodes: all nodes that they depend on, operands first.
    """

    results: list[Number]
    nodes: list[Node]
    _places: dict = dataclasses.field(default_factory=dict)
    _numbers: list = dataclasses.field(default_factory=list)
    _tapes: dict[Functions, list] = dataclasses.field(default_factory=dict)
    _steady: dict[int, list] = dataclasses.field(default_factory=dict)

    @classmethod
    def of(cls, graph: Graph, results: list[Number]) -> "Program":
        """The program of some results."""
        return cls(results, topological_order(graph, results))

    def __call__(self, inputs: dict[Node, Any], functions: Functions = REAL) -> list:
        """The results for values of the inputs: arb, acb or series of them.

        Raises:
          Undecided: a condition holds only for some of the numbers.
        """
        if functions not in self._tapes:
            self._tapes[functions] = self._tape(functions)
        values = self._constants().copy()
        for node, x in inputs.items():
            if node in self._places:
                values[self._places[node]] = x
        for place, operation in self._tapes[functions]:
            values[place] = operation(values)
        return [values[self._place(r)] for r in self.results]

    def _place(self, a: Number | None) -> int:
        """The place of a number; a new one is given a place."""
        key = a if isinstance(a, Node) else (type(a), a)
        if key not in self._places:
            self._places[key] = len(self._numbers)
            known = None if isinstance(a, Node) else a if isinstance(a, bool) else arb(a)
            self._numbers.append(known)
        return self._places[key]

    def _tape(self, functions: Functions) -> list[tuple[int, Operation]]:
        """The operations that remain once the constants are known, with places of their results."""
        for result in self.results:
            self._place(result)
        steady = self._steady_nodes()
        waiting = [n for n in self.nodes if n not in steady and n.op not in ("input", "given")]
        tape = [(self._place(node), _operation(node, self._place, functions)) for node in waiting]
        for node in self.nodes:
            self._place(node)
        self._steady.clear()  # shorter than the places are now
        return tape

    def _steady_nodes(self) -> dict[Node, None]:
        """Nodes that depend on no input."""
        found: dict[Node, None] = {}
        for node in self.nodes:
            operands = (a for a in node.args if isinstance(a, Node))
            if not node.moving and node.op != "given" and all(a in found for a in operands):
                found[node] = None
        return found

    def _constants(self) -> list:
        """The values at all places; those that depend on no input, at the present precision."""
        bits = flint.ctx.prec
        if bits not in self._steady:
            steady = [
                (self._place(n), _operation(n, self._place, REAL)) for n in self._steady_nodes()
            ]
            values = list(self._numbers)
            for place, operation in steady:
                values[place] = operation(values)
            self._steady[bits] = values
        return self._steady[bits]


def _operation(node: Node, place: Callable, functions: Functions) -> Operation:
    op, args = node.op, node.args
    if op == "sum":
        return _sum(args, place)
    if op == "pow":
        base, exponent = args
        return _power(base, exponent, place, functions)
    at = [place(a) for a in args]
    if op in _BINARY:
        return _of_two(_BINARY[op], *at) if len(at) == 2 else _of_many(_BINARY[op], at)
    if op in COMPARISONS:
        moving = any(isinstance(a, Node) and a.moving for a in args)
        one_point = not (functions.analytic and moving)
        return lambda v: _compare(op, v[at[0]], v[at[1]], at_one_point=one_point)
    if op in LOGIC:
        return lambda v: _LOGIC[op](*(v[i] for i in at))
    if op in TESTS:
        return lambda v: v[at[0]].is_finite()
    if op == "select":
        return lambda v: v[at[2]] if v[at[0]] else v[at[1]]
    if op == "real":
        return lambda v: arb(int(v[at[0]]))
    return lambda v: functions.apply(op, v[at[0]])


def _of_two(apply: Callable, i: int, j: int) -> Operation:
    return lambda v: apply(v[i], v[j])


def _of_many(apply: Callable, at: list[int]) -> Operation:
    return lambda v: functools.reduce(apply, [v[i] for i in at])


def _power(base: Number, exponent: Number, place: Callable, functions: Functions) -> Operation:
    i = place(base)
    if not isinstance(exponent, Node):
        return lambda v: functions.power(v[i], exponent)
    j = place(exponent)
    return lambda v: functions.power(v[i], v[j])


def _sum(args: tuple, place: Callable) -> Operation:
    """The operation of a sum of factors times terms; factors of 1 and -1 take no product."""
    plus, minus, scaled = [], [], []
    for factor, term in zip(args[::2], args[1::2], strict=True):
        if term is None:
            plus.append(place(factor))
        elif not isinstance(factor, Node) and abs(factor) == 1:
            (plus if factor > 0 else minus).append(place(term))
        else:
            scaled.append((place(factor), place(term)))
    if len(plus) == 2 and not minus and not scaled:
        return _of_two(operator.add, *plus)
    if len(plus) == 1 and len(minus) == 1 and not scaled:
        return _of_two(operator.sub, *plus, *minus)

    def total(v: list):
        parts = [v[i] for i in plus]
        parts += [v[i] * v[j] for i, j in scaled]
        found = functools.reduce(operator.add, parts) if parts else -v[minus[0]]
        for i in minus if parts else minus[1:]:
            found = found - v[i]
        return found

    return total


def _compare(op: str, a, b, *, at_one_point: bool) -> bool:
    """Whether a comparison holds for all numbers of two balls, or for none.

    Series are compared by their first coefficients: that a motion leaves the case is noticed on the
    disc about the whole step, on which numbers are never equal (`at_one_point` is false).
    """
    a, b = (x[0] if isinstance(x, arb_series) else x for x in (a, b))
    if op in ("eq", "ne"):
        if not a.overlaps(b):
            return op == "ne"
        if at_one_point and a.is_exact() and b.is_exact():
            return op == "eq"
    elif a < b or a > b or (a.is_exact() and b.is_exact()):
        return bool(COMPARISONS[op](a, b))
    raise Undecided(f"whether {op} of {a} and {b}")


_BINARY: dict[str, Callable] = {
    **{"add": operator.add, "mul": operator.mul, "scale": operator.mul},
    **{"product": operator.mul, "div": operator.truediv},
}
_LOGIC = {"and": operator.and_, "or": operator.or_, "not": operator.not_}
