"""Unit vectors a / |a| in a rate, on boxes in which the length |a| may be 0.

A quotient a_i / |a| has no bound there if numerator and denominator are enclosed separately. It is
an entry of a unit vector, so the rate is evaluated for each arc of directions instead, with any
length from 0 on: all points of the box with |a| > 0 are among these. Where |a| is exactly 0, the
rate has the value of its case for that (a spring without length), whose formulas are evaluated on
the same box; or it has no value, since it divides by 0, and so is not 0 there either.
"""

import math
from typing import NamedTuple

from jaxdyn.ball_arithmetic.arithmetic import Undecided, arb
from jaxdyn.ball_arithmetic.field import BallField
from jaxdyn.ball_arithmetic.program import Program
from jaxdyn.solvers.formulas.graph import COMPARISONS, LOGIC, Graph, Node, Number

_MOST_ARCS = 512  # most arcs that are tried for a box


class Length(NamedTuple):
    """A length in a rate, and the rate without its quotients.

    Attributes:
      entries: the program of the entries a_i.
      length: the input that stands for |a|.
      unit: the inputs that stand for a_i / |a|.
      moving: the rate for |a| > 0, as a function of the inputs of the rate and of these.
      ending: the rate for |a| = 0; NaN for a number without a value.
    """

    entries: Program
    length: Node
    unit: list[Node]
    moving: Program
    ending: Program


def lengths(field: BallField) -> list[Length]:
    """The lengths of vectors with one to three entries in a rate."""
    found = []
    for square in [node for node in field.rates.nodes if node.op == "sum"]:
        entries = _entries(square)
        if entries and any(_is_root(node, square) for node in field.rates.nodes):
            found.append(_length(field, square, entries))
    return found


def _entries(square: Node) -> list[Node]:
    """The a_i of a sum of squares a_i^2; [] for another node."""
    pairs = list(zip(square.args[::2], square.args[1::2], strict=True))
    squares = all(
        factor == 1.0
        and isinstance(term, Node)
        and term.op == "product"
        and len(set(term.args)) == 1
        for factor, term in pairs
    )
    return [term.args[0] for _, term in pairs] if squares and len(pairs) <= 3 else []


def _is_root(node: Node, square: Node) -> bool:
    """Whether a node is the root of a square, or of a selection that contains the square."""
    if node.op != "sqrt":
        return False
    (inner,) = node.args
    return inner is square or (
        isinstance(inner, Node) and inner.op == "select" and square in inner.args[1:]
    )


def _length(field: BallField, square: Node, entries: list[Node]) -> Length:
    graph = field.graph
    length = graph.input(arb(0), moving=True)
    unit = [graph.input(arb(0), moving=True) for _ in entries]
    moving = _Rewriting(graph, field.rates, square, _Direction(entries, length, unit))
    ending = _Rewriting(graph, field.rates, square, None)
    ending.new |= dict.fromkeys([*entries, square], 0.0)
    return Length(
        entries=Program.of(graph, list(entries)),
        length=length,
        unit=unit,
        moving=moving.program(),
        ending=ending.program(),
    )


class _Direction(NamedTuple):
    """The nodes for the entries, and the inputs for their length and quotients."""

    entries: list[Node]
    length: Node
    unit: list[Node]


class _Rewriting:
    """The formulas of a rate where a square is 0, or with a direction where it is not."""

    def __init__(self, graph: Graph, rates: Program, square: Node, direction: _Direction | None):
        self.graph, self.rates, self.square, self.direction = graph, rates, square, direction
        self.new: dict[Node, Number] = {}

    def program(self) -> Program:
        """The rewritten rate."""
        for node in self.rates.nodes:
            self.new.setdefault(node, self._rewrite(node))
        return Program.of(self.graph, [self._of(r) for r in self.rates.results])

    def _of(self, a):
        return self.new.get(a, a) if isinstance(a, Node) else a

    def _rewrite(self, node: Node) -> Number:
        args = [self._of(a) for a in node.args]
        if node.op in COMPARISONS:
            return self._compare(node.op, args)
        known = all(isinstance(a, bool) for a in args)
        if node.op in LOGIC and known:
            return LOGIC[node.op](*args)
        if node.op == "select" and isinstance(args[0], bool):
            return args[2] if args[0] else args[1]
        if self.direction is not None:
            if node.op == "sqrt" and args[0] is self.square:
                return self.direction.length
            if node.op == "div" and args[1] is self.direction.length:
                return self._quotient(args[0], self.direction)
        elif (found := self._at_zero(node, args)) is not None:
            return found
        if all(a is b for a, b in zip(args, node.args, strict=True)):
            return node
        return self.graph.node(node.op, *args)

    def _at_zero(self, node: Node, args: list) -> float | None:
        """The known value of a number where the square is 0; NaN if it has no value.

        Only 0 / 0 and what depends on it has no value: 1 / 0 may be infinite, and 1 over that 0.
        """
        if any(isinstance(a, float) and math.isnan(a) for a in args) and node.op != "select":
            return math.nan
        if node.op == "sqrt" and args[0] == 0.0:
            return 0.0
        return math.nan if node.op == "div" and args[1] == 0.0 and _is_zero(args[0]) else None

    def _compare(self, op: str, args: list) -> Number:
        if self.direction is not None and op in ("eq", "ne") and 0.0 in args:
            if any(a is self.square or a is self.direction.length for a in args):
                return op == "ne"
        if not any(isinstance(a, Node) for a in args):
            return bool(COMPARISONS[op](*args))
        return self.graph.node(op, *args)

    def _quotient(self, a: Number, direction: _Direction) -> Number:
        """The quotient of a number by the length, where an entry may be a factor of the number."""
        factors = list(a.args) if isinstance(a, Node) and a.op in ("product", "scale") else [a]
        for entry, one in zip(direction.entries, direction.unit, strict=True):
            if self._of(entry) in factors:
                factors.remove(self._of(entry))
                return self.graph.node("product", one, *factors) if factors else one
        return self.graph.node("div", a, direction.length)


def _is_zero(a: Number) -> bool:
    """Whether a number is 0, or 0 times others."""
    if isinstance(a, Node):
        return a.op in ("product", "scale", "mul") and any(_is_zero(b) for b in a.args)
    return a == 0.0


def excludes_zero(field: BallField, found: list[Length], rows: list[int], t: arb, y: list) -> bool:
    """Whether at each point of a box some rate of `rows` is proved not to be 0.

    Args:
      field: the rate.
      found: its lengths; one of them may be 0 in the box.
      rows: indices of the rates.
      t: () the time.
      y: (k) the box.
    """
    inputs = field.inputs(t, y)
    enclosed = [one.entries(inputs) for one in found]
    small = [i for i, entries in enumerate(enclosed) if all(bool(x.contains(0)) for x in entries)]
    if len(small) != 1:
        return False
    one, entries = found[small[0]], enclosed[small[0]]
    if not _excludes(one.ending, rows, inputs):
        return False
    longest = sum((abs(x) ** 2 for x in entries), arb(0)).sqrt().upper()
    inputs[one.length] = arb(longest / 2, longest / 2)
    waiting = _all_directions(len(one.unit))
    for _ in range(_MOST_ARCS):
        if not waiting:
            return True
        angles = waiting.pop()
        direction = dict(zip(one.unit, _unit_vector(angles, len(one.unit)), strict=True))
        if not _excludes(one.moving, rows, inputs | direction):
            if not angles or isinstance(angles, int):
                return False
            waiting += _halves(angles)
    return False


def _excludes(program: Program, rows: list[int], inputs: dict) -> bool:
    try:
        rates = program(inputs)
    except (Undecided, ZeroDivisionError):
        return False
    return any(_has_no_value(program.results[i]) or not arb(rates[i]).contains(0) for i in rows)


def _has_no_value(rate: Number) -> bool:
    return isinstance(rate, float) and math.isnan(rate)


def _all_directions(count: int) -> list:
    """The angles of all unit vectors; for vectors of one entry, its signs."""
    if count == 1:
        return [1, -1]
    whole = (0.0, 6.3)
    return [[whole]] if count == 2 else [[whole, (0.0, 3.15)]]


def _unit_vector(angles, count: int) -> list[arb]:
    if count == 1:
        return [arb(angles)]
    balls = [arb(low).union(arb(high)) for low, high in angles]
    across = balls[0].cos(), balls[0].sin()
    if count == 2:
        return list(across)
    return [balls[1].sin() * across[0], balls[1].sin() * across[1], balls[1].cos()]


def _halves(angles: list) -> list[list]:
    """The angles with the widest interval cut in two."""
    widths = [high - low for low, high in angles]
    at = widths.index(max(widths))
    low, high = angles[at]
    middle = (low + high) / 2
    return [[*angles[:at], part, *angles[at + 1 :]] for part in ((low, middle), (middle, high))]
